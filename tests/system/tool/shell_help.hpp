#pragma once

#include <string>
#include <vector>

namespace rtpm::system_test {

/// The commands in --help, including subcommands: "list", "config set".
/// @param path  the command that has them; empty for the program itself
[[nodiscard]] std::vector<std::string> commands_below(const std::string& path);

}  // namespace rtpm::system_test
