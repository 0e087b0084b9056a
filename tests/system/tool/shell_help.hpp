#pragma once

#include <string>
#include <vector>

namespace rtpm::system_test {

/// The commands in --help, those below others too: "list", "config set".
/// @param path  of the command that has them; empty: the program
[[nodiscard]] std::vector<std::string> commands_below(const std::string& path);

}  // namespace rtpm::system_test
