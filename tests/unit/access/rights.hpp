#pragma once

#include <string>

/// The rights of other users to a file, by the means of the operating system.
namespace rtpm::access {

void keep_for_this_user(const std::string& path);
void let_others_read(const std::string& path);
void let_others_write(const std::string& path);
/// Whether they may read or write a file or folder.
[[nodiscard]] bool are_others_allowed(const std::string& path);

/// A part of the remedy for a secret file, and for one that others can write.
extern const std::string kRemedyOfReading;
extern const std::string kRemedyOfWriting;

}  // namespace rtpm::access
