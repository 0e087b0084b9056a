#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/expected.hpp"
#include "setting.hpp"

namespace rtpm::options {

/// What is wrong with what the user gave: a clause that names it.
struct UsageError {
  std::string text;
};

/// A command line taken apart, its values not yet read.
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

/// Takes the arguments after the program's name apart. `--key value`, `--key=value`, for switches
/// `--key` too; after `--`, and without a leading `-`, stand positionals, to which negative numbers
/// and `-` belong.   Set-up only.
/// Errors: a flag that is in none of `settings`, lacks its value or is repeated without being a
/// list.
[[nodiscard]] expected<CommandLine, UsageError> parse_command_line(
    const std::vector<std::string_view>& arguments, const std::vector<Setting>& settings);

/// The value of a flag, given once or more often, as far as it can be told without knowing which
/// other flags take one: for those that decide about that.   Set-up only.
[[nodiscard]] std::optional<std::string> early_flag(const std::string& flag,
                                                    const std::vector<std::string_view>& arguments);

/// " (did you mean 'port'?)", or nothing if no candidate resembles `word`.
[[nodiscard]] std::string suggestion(std::string_view word,
                                     const std::vector<std::string>& candidates);

}  // namespace rtpm::options
