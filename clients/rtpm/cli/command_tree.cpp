#include "cli/command_tree.hpp"

#include <algorithm>
#include <sstream>

namespace rtpm::tool {
namespace {

/// The choices in a type description, such as "TEXT:{device,server}".
std::vector<std::string> choices_in(const std::string& type) {
  const std::size_t begin = type.find('{');
  const std::size_t end = type.find('}');
  std::vector<std::string> choices;
  if (begin == std::string::npos || end == std::string::npos) return choices;
  std::istringstream list(type.substr(begin + 1, end - begin - 1));
  for (std::string choice; std::getline(list, choice, ',');)
    choices.push_back(choice);
  return choices;
}

OptionFacts facts_of(const CLI::Option& option) {
  const std::string type = option.get_type_name();
  OptionFacts facts{.name = option.get_positional()       ? option.get_name(true)
                            : option.get_lnames().empty() ? option.get_name()
                                                          : "--" + option.get_lnames().front(),
                    .value = type.substr(0, type.find(':')),
                    .help = option.get_description(),
                    .choices = choices_in(type),
                    .is_positional = option.get_positional(),
                    .is_required = option.get_required(),
                    .is_list = option.get_items_expected_max() > 1};
  if (!facts.is_positional && facts.value.empty() && option.get_items_expected_max() > 0) {
    facts.value = "VALUE";
  }
  return facts;
}

CommandFacts facts_below(const CLI::App& app, const std::string& path) {
  CommandFacts facts{.path = path,
                     .name = app.get_name(),
                     .summary = app.get_description(),
                     .details = app.get_footer()};
  for (const CLI::Option* option : app.get_options())
    facts.options.push_back(facts_of(*option));
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; }))
    facts.commands.push_back(
        facts_below(*command, (path.empty() ? "" : path + " ") + command->get_name()));
  return facts;
}

void flatten(const CommandFacts& command, std::vector<const CommandFacts*>& list) {
  list.push_back(&command);
  for (const CommandFacts& below : command.commands)
    flatten(below, list);
}

}  // namespace

bool CommandFacts::takes_name() const {
  return std::ranges::any_of(options, [](const OptionFacts& option) {
    return option.is_positional && (option.name == "TARGET" || option.name == "DEVICE");
  });
}

bool CommandFacts::takes_file() const {
  return std::ranges::any_of(options, [](const OptionFacts& option) {
    return option.name == "FILE" || option.value == "FILE";
  });
}

CommandFacts facts_of(const CLI::App& program) {
  return facts_below(program, "");
}

std::vector<const CommandFacts*> flattened(const CommandFacts& command) {
  std::vector<const CommandFacts*> list;
  flatten(command, list);
  return list;
}

}  // namespace rtpm::tool
