#pragma once

#include <CLI/CLI.hpp>
#include <limits>
#include <optional>
#include <string>

#include "cli/context.hpp"
#include "rtpm/base/priority.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/options/options.hpp"

namespace rtpm::tool {

/// Adds a command to the program, or to a command group.
/// @param details  complete lines after the options in --help, with an example; may be empty
CLI::App& add_command(CLI::App& parent, Context& context, const std::string& name,
                      const std::string& summary, const std::string& details, Run run);

/// Adds a command that has subcommands, and requires one of them.
CLI::App& add_command_group(CLI::App& parent, const std::string& name, const std::string& summary);

/// Adds an option whose value has a unit: "800us", "2 s".
CLI::Option& add_duration(CLI::App& command, const std::string& name, Duration& value,
                          const std::string& help,
                          options::Range<Duration> range = {Duration{0}, Duration::max()});
CLI::Option& add_duration(CLI::App& command, const std::string& name,
                          std::optional<Duration>& value, const std::string& help,
                          options::Range<Duration> range = {Duration{0}, Duration::max()});
/// Adds an option that is a whole number within its range.
template <class Number>
CLI::Option& add_count(CLI::App& command, const std::string& name, Number& value,
                       const std::string& help, Number low = 0,
                       Number high = std::numeric_limits<Number>::max()) {
  CLI::Option& option = *command.add_option(name, value, help)->capture_default_str();
  // Runs before the conversion, which would turn -1 into the largest number.
  option.check([](const std::string& text) {
    const bool is_whole = text.find_first_not_of("0123456789") == std::string::npos;
    return is_whole ? std::string{} : "'" + text + "' is no whole number";
  });
  if (low > 0 || high < std::numeric_limits<Number>::max()) option.check(CLI::Range(low, high));
  return *option.type_name("COUNT");
}

/// Adds the positional argument that names an object: "TARGET", "DEVICE". Shells complete it with
/// the registry's names.
CLI::Option& add_target(CLI::App& command, std::string& target, const std::string& name = "TARGET");

/// Ends parsing with an error; `clause` describes it.
[[noreturn]] void refuse(const std::string& clause);

}  // namespace rtpm::tool
