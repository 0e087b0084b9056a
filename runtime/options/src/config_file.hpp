#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "setting.hpp"

namespace rtpm::options {

/// One `key = value` of a configuration file, the value without its quotes.
struct ConfigLine {
  std::string key;
  std::string value;
  int line = 0;  ///< Counted from 1.
};

/// Larger files are refused: a wrong path must not exhaust the memory.
inline constexpr std::size_t kConfigSizeMax = std::size_t{1024} * 1024;

/// The lines of the file at `path`, in their order.
/// @realtime set-up only
/// @errors   an unreadable file, a line that is not `key = value`
[[nodiscard]] expected<std::vector<ConfigLine>, SetupError> read_config_file(
    const std::string& path);

/// `value` in the form of a file, quoted if necessary.
/// @realtime set-up only
[[nodiscard]] std::string config_value_text(std::string_view value);

}  // namespace rtpm::options
