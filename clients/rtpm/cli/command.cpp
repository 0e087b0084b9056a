#include "cli/command.hpp"

#include <utility>

#include "rtpm/base/printable.hpp"
#include "rtpm/program/duration.hpp"

namespace rtpm::tool {
namespace {

/// Reads a duration within its range into `take`.
CLI::Option& add_checked_duration(CLI::App& command, const std::string& name,
                                  const std::string& help, options::Range<Duration> range,
                                  std::function<void(Duration)> take) {
  CLI::callback_t read = [name, range, take = std::move(take)](const CLI::results_t& given) {
    const auto value = program::parse_duration(given.front());
    if (!value) {
      refuse("'" + given.front() + "' of " + name + " is no duration, such as 800us, 20ms or 2s");
    }
    if (*value < range.low || *value > range.high) {
      refuse(name + " is " + given.front() + ", but must be " + program::duration_text(range.low) +
             " to " + program::duration_text(range.high));
    }
    take(*value);
    return true;
  };
  return *command.add_option(name, std::move(read), help)->type_name("TIME");
}

}  // namespace

CLI::App& add_command(CLI::App& parent, Context& context, const std::string& name,
                      const std::string& summary, const std::string& details, Run run) {
  CLI::App& command = *parent.add_subcommand(name, summary);
  command.footer(details)->group("Commands");
  command.final_callback([&context, run = std::move(run)] { context.chosen = run; });
  return command;
}

CLI::App& add_command_group(CLI::App& parent, const std::string& name, const std::string& summary) {
  CLI::App& group = *parent.add_subcommand(name, summary);
  group.require_subcommand(1)->group("Commands");
  return group;
}

CLI::Option& add_duration(CLI::App& command, const std::string& name, Duration& value,
                          const std::string& help, options::Range<Duration> range) {
  CLI::Option& option =
      add_checked_duration(command, name, help, range, [&value](Duration given) { value = given; });
  return *option.default_str(program::duration_text(value));
}

CLI::Option& add_duration(CLI::App& command, const std::string& name,
                          std::optional<Duration>& value, const std::string& help,
                          options::Range<Duration> range) {
  return add_checked_duration(command, name, help, range,
                              [&value](Duration given) { value = given; });
}

CLI::Option& add_target(CLI::App& command, std::string& target, const std::string& name) {
  return *command
              .add_option(name, target, "A name in the registry, or a URL rtpm://host:port/path")
              ->required()
              ->type_name("");
}

void refuse(const std::string& clause) {
  throw CLI::ValidationError(clause);
}

}  // namespace rtpm::tool
