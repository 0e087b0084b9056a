#pragma once

#include <string>
#include <vector>

#include "rtpm/base/setup_error.hpp"

namespace rtpm::options {

/// A key of a configuration file with its value, or a table.
struct ConfigEntry {
  std::vector<std::string> path{};   ///< The key behind the names of its tables.
  std::vector<std::string> texts{};  ///< The value: one text, or those of a list.
  bool is_table = false;
  std::string place{};  ///< "cell.toml:3:8"
};

/// The entries of a TOML file in their order, each table before its keys.
/// @param name  "cell.toml", or "cell.toml#devices" for the table `config` of the [[program]] of
///              that name
/// @realtime set-up only
/// @errors   an unreadable file; no TOML; no such program; a table in a list: with line and column
[[nodiscard]] expected<std::vector<ConfigEntry>, SetupError> read_config_file(
    const std::string& name);

}  // namespace rtpm::options
