#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "setting.hpp"

namespace rtpm::options {

/// A command line split into flags and positionals, its values not yet parsed.
struct CommandLine {
  std::map<std::string, std::string, std::less<>> values;  ///< By key; a list's joined with commas.
  std::vector<std::string> positionals;
  bool wants_help = false;
  bool wants_version = false;
  bool wants_dump = false;

  [[nodiscard]] const std::string* find(std::string_view key) const {
    const auto found = values.find(key);
    return found == values.end() ? nullptr : &found->second;
  }
};

/// Splits the arguments after the program's name: `--key value`, `--key=value`, for switches also
/// `--key`. Arguments after `--`, those without a leading `-`, negative numbers and `-` are
/// positionals.
/// @realtime set-up only
/// @errors   an unknown flag, a flag without its value, a repeated flag that is not a list
[[nodiscard]] expected<CommandLine, SetupError> parse_command_line(
    const std::vector<std::string_view>& arguments, const std::vector<Setting>& settings);

/// The value of a flag, its repetitions joined by commas, before all flags are known: for options
/// that add others.
/// @realtime set-up only
[[nodiscard]] std::optional<std::string> early_flag(const std::string& flag,
                                                    const std::vector<std::string_view>& arguments);

}  // namespace rtpm::options
