#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/expected.hpp"

namespace rtpm::options {

/// One `key = value` of a configuration file, the value without its quotes.
struct ConfigLine {
  std::string key;
  std::string value;
  int line = 0;  ///< Counted from 1.
};

/// Why a file is no configuration: a clause that names the file and, where there is one, the line.
struct ConfigError {
  std::string text;
};

/// Longer files are refused, lest a wrong path fill the memory.
inline constexpr std::size_t kConfigSizeMax = std::size_t{1024} * 1024;

/// The lines of the file at `path`, in their order.   Set-up only.
/// Errors: a file that can't be read, a line that is not `key = value`.
[[nodiscard]] expected<std::vector<ConfigLine>, ConfigError> read_config_file(
    const std::string& path);

/// `value` as it stands in a file, in quotes if it needs them.   Set-up only.
[[nodiscard]] std::string config_value_text(std::string_view value);

}  // namespace rtpm::options
