#include "rtpm/options/options.hpp"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <utility>

#include "command_line.hpp"
#include "config_file.hpp"
#include "rtpm/base/assert.hpp"
#include "rtpm/options/suggestion.hpp"
#include "rtpm/rt/log.hpp"
#include "setting.hpp"

namespace rtpm::options {
namespace {

constexpr std::string_view kConfigKey = "config";
constexpr std::string_view kVariablePrefix = "RTPM_";

struct Positional {
  std::string name;
  Setting setting;
  Presence presence;
};

/// A list of names, each with options of its own.
struct Group {
  std::string key;
  bool is_shared;
  std::vector<std::string>* names;
  std::function<void(const std::vector<std::string>&)> add_members;
};

struct Verb {
  std::string name;
  std::string arguments;
  std::string help;
  std::string details;

  [[nodiscard]] std::string form() const {
    return arguments.empty() ? name : name + ' ' + arguments;
  }
};

std::string variable_of(std::string_view key) {
  std::string variable(kVariablePrefix);
  for (const char character : key) {
    const bool is_lower = character >= 'a' && character <= 'z';
    const bool is_dash = character == '-' || character == '.';
    variable += is_dash ? '_' : static_cast<char>(is_lower ? character - 'a' + 'A' : character);
  }
  return variable;
}

/// `names_member`: a part of it is a name at a registry.
bool is_key(std::string_view key, bool names_member) {
  constexpr std::string_view kLetters =
      "abcdefghijklmnopqrstuvwxyz0123456789-ABCDEFGHIJKLMNOPQRSTUVWXYZ._";
  const std::string_view letters = names_member ? kLetters : kLetters.substr(0, 37);
  return !key.empty() && key.front() >= 'a' && key.front() <= 'z' &&
         key.find_first_not_of(letters) == std::string_view::npos;
}

/// One row of --help: `left` padded to a common width, then `right`.
std::string help_row(std::string_view left, std::string_view right) {
  constexpr std::size_t kWidth = 32;
  std::string row = "  ";
  row += left;
  row +=
      left.size() < kWidth ? std::string(kWidth - left.size(), ' ') : "\n" + std::string(34, ' ');
  row += right;
  return row + "\n";
}

/// An option whose values are an enum's names.
template <class Enum, std::size_t Count>
Setting enum_setting(Enum& value, const std::array<Enum, Count>& values) {
  std::vector<std::string> words;
  words.reserve(Count);
  for (const Enum candidate : values)
    words.emplace_back(to_string(candidate));
  return setting_of_choice(
      words,
      [&value, values](std::string_view word) {
        for (const Enum candidate : values) {
          if (to_string(candidate) == word) value = candidate;
        }
      },
      [&value] { return std::string(to_string(value)); });
}

}  // namespace

struct Options::Impl {
  /// The place of names: the registry's URL or, without one, how to find them.
  struct NamesPlace {
    std::string* where = nullptr;  ///< Null if the program has no use for them.
    std::string registry{};
    std::string discover{};
    [[nodiscard]] const std::string& chosen() const {
      return registry.empty() ? discover : registry;
    }
  };

  std::string name;
  std::string description;
  std::vector<Setting> settings{};
  std::vector<std::string> sources{};  ///< The source of each setting's value.
  std::vector<Positional> positionals{};
  std::vector<Verb> verbs{};
  std::string config_path{};
  std::vector<Group> groups{};
  bool is_adding_members = false;
  NamesPlace names_place{};
  bool is_shared = false;  ///< Added options mean the same in all programs.

  /// "RTPM_SERVO_RATE", or "RTPM_REGISTRY".
  [[nodiscard]] std::string variable_for(std::string_view key, bool is_for_all) const {
    constexpr std::string_view kCommonBegin = "rtpm-";
    const std::string own =
        name.starts_with(kCommonBegin) ? name.substr(kCommonBegin.size()) : name;
    return variable_of(is_for_all ? std::string(key) : own + "-" + std::string(key));
  }

  void add(std::string key, std::string help, Setting setting) {
    RTPM_ASSERT(is_key(key, is_adding_members), "a key is of lower-case letters, digits and '-'");
    RTPM_ASSERT(key != "help" && key != "version" && key != "dump-config" && find(key) == nullptr,
                "the key is already in use");
    setting.variable = variable_for(key, is_shared);
    setting.key = std::move(key);
    setting.help = std::move(help);
    settings.push_back(std::move(setting));
    sources.emplace_back("default");
  }

  Setting* find(std::string_view key) {
    const auto found = std::find_if(settings.begin(), settings.end(),
                                    [&](const Setting& setting) { return setting.key == key; });
    return found == settings.end() ? nullptr : &*found;
  }

  /// Sets the variable; `origin` locates the text in error messages, `source` in --dump-config.
  expected<void, SetupError> apply(Setting& setting, std::string_view text,
                                   const std::string& origin, std::string source) {
    if (!setting.read(text)) {
      return unexpected{
          SetupError{origin + " '" + std::string(text) + "' is not " + setting.expected}};
    }
    sources[static_cast<std::size_t>(&setting - settings.data())] = std::move(source);
    return {};
  }

  [[nodiscard]] std::optional<std::string> early_text(
      const Setting& setting, const std::vector<std::string_view>& arguments) const;
  void add_members(const std::vector<std::string_view>& arguments);
  expected<void, SetupError> apply_file(const std::string& path);
  expected<void, SetupError> apply_environment(const CommandLine& command_line);
  expected<void, SetupError> apply_flags(const CommandLine& command_line);
  expected<void, SetupError> apply_positionals(const CommandLine& command_line);
  expected<void, SetupError> apply_all(const CommandLine& command_line);
  [[nodiscard]] expected<const Verb*, SetupError> verb_in(const CommandLine& command_line) const;
  [[nodiscard]] std::string usage_text() const;
  [[nodiscard]] std::string help_text(const Verb* verb) const;
  [[nodiscard]] std::string dump_text();
};

/// The text of a key before all keys are known. Errors in it are reported later.
std::optional<std::string> Options::Impl::early_text(
    const Setting& setting, const std::vector<std::string_view>& arguments) const {
  if (auto text = early_flag("--" + setting.key, arguments)) return text;
  if (const char* const text = std::getenv(setting.variable.c_str())) return text;
  std::optional<std::string> path = early_flag("--" + std::string(kConfigKey), arguments);
  const char* const config_variable = std::getenv(variable_of(kConfigKey).c_str());
  if (!path && config_variable != nullptr) path = config_variable;
  if (!path) return std::nullopt;
  const auto lines = read_config_file(*path);
  if (!lines) return std::nullopt;
  const auto line = std::ranges::find(*lines, setting.key, &ConfigLine::key);
  return line == lines->end() ? std::nullopt : std::optional(line->value);
}

void Options::Impl::add_members(const std::vector<std::string_view>& arguments) {
  for (const Group& group : std::exchange(groups, {})) {
    const Setting& setting = *find(group.key);
    if (const auto text = early_text(setting, arguments)) static_cast<void>(setting.read(*text));
    is_shared = group.is_shared;
    is_adding_members = true;
    group.add_members(*group.names);
    is_adding_members = false;
  }
  is_shared = false;
}

expected<void, SetupError> Options::Impl::apply_file(const std::string& path) {
  const auto lines = read_config_file(path);
  if (!lines) return unexpected{lines.error()};
  std::vector<std::string> seen;
  for (const ConfigLine& line : *lines) {
    const std::string place = path + ":" + std::to_string(line.line);
    Setting* const setting = line.key == kConfigKey ? nullptr : find(line.key);
    if (setting == nullptr) {
      std::vector<std::string> keys;
      for (const Setting& candidate : settings) {
        if (candidate.key != kConfigKey) keys.push_back(candidate.key);
      }
      return unexpected{
          SetupError{place + ": unknown key '" + line.key + "'" + suggestion(line.key, keys)}};
    }
    if (std::find(seen.begin(), seen.end(), line.key) != seen.end()) {
      return unexpected{SetupError{place + ": key '" + line.key + "' is given twice"}};
    }
    seen.push_back(line.key);
    if (auto applied = apply(*setting, line.value, place + ": " + line.key, place); !applied) {
      return applied;
    }
  }
  return {};
}

expected<void, SetupError> Options::Impl::apply_environment(const CommandLine& command_line) {
  for (Setting& setting : settings) {
    const char* const text = std::getenv(setting.variable.c_str());
    // A variable that a flag overrides is not read.
    if (text == nullptr || command_line.find(setting.key) != nullptr) continue;
    if (auto applied = apply(setting, text, setting.variable, setting.variable); !applied)
      return applied;
  }
  return {};
}

expected<void, SetupError> Options::Impl::apply_flags(const CommandLine& command_line) {
  for (Setting& setting : settings) {
    const std::string* const text = command_line.find(setting.key);
    if (text == nullptr) continue;
    const std::string flag = "--" + setting.key;
    if (auto applied = apply(setting, *text, flag, flag); !applied) return applied;
  }
  return {};
}

expected<void, SetupError> Options::Impl::apply_positionals(const CommandLine& command_line) {
  const std::vector<std::string>& given = command_line.positionals;
  std::size_t next = 0;
  for (Positional& positional : positionals) {
    if (next == given.size()) {
      if (positional.presence == Presence::kOptional) continue;
      return unexpected{SetupError{"the argument " + positional.name + " is missing"}};
    }
    // A list takes its items one by one: here commas are part of them.
    do {
      static_cast<void>(positional.setting.read(given[next++]));
    } while (positional.setting.is_list && next < given.size());
  }
  if (next < given.size()) {
    return unexpected{SetupError{"unexpected argument '" + given[next] + "'"}};
  }
  return {};
}

expected<void, SetupError> Options::Impl::apply_all(const CommandLine& command_line) {
  const char* const config_variable = std::getenv(variable_of(kConfigKey).c_str());
  const std::string* const config_flag = command_line.find(kConfigKey);
  if (config_flag != nullptr || config_variable != nullptr) {
    const std::string path = config_flag != nullptr ? *config_flag : config_variable;
    if (auto applied = apply_file(path); !applied) return applied;
  }
  if (auto applied = apply_environment(command_line); !applied) return applied;
  return apply_flags(command_line);
}

/// The verb on the command line; null without one, or if the program has no verbs.
expected<const Verb*, SetupError> Options::Impl::verb_in(const CommandLine& command_line) const {
  if (verbs.empty() || command_line.positionals.empty()) return nullptr;
  const std::string& word = command_line.positionals.front();
  const auto found = std::ranges::find(verbs, word, &Verb::name);
  if (found != verbs.end()) return &*found;
  std::vector<std::string> names;
  for (const Verb& verb : verbs)
    names.push_back(verb.name);
  return unexpected{SetupError{"unknown verb '" + word + "'" + suggestion(word, names)}};
}

/// The first part of --help, before the options.
std::string Options::Impl::usage_text() const {
  std::string usage = "Usage: " + name + " [options]";
  std::string arguments;
  for (const Positional& positional : positionals) {
    std::string shown = positional.name + (positional.setting.is_list ? "..." : "");
    arguments += help_row(shown, positional.setting.help);
    usage += positional.presence == Presence::kRequired ? " " + shown : " [" + shown + "]";
  }
  std::string text = name + ": " + description + "\n\n" + usage + "\n";
  if (!arguments.empty()) text += "\nArguments:\n" + arguments;
  if (verbs.empty()) return text;
  text += "\nVerbs ('" + name + " VERB --help' explains one):\n";
  for (const Verb& verb : verbs)
    text += help_row(verb.form(), verb.help);
  return text;
}

std::string Options::Impl::help_text(const Verb* verb) const {
  std::string text = usage_text();
  if (verb != nullptr) {
    text = name + ' ' + verb->name + ": " + verb->help + "\n\nUsage: " + name + ' ' + verb->form() +
           " [options]\n" + (verb->details.empty() ? "" : "\n") + verb->details;
  }
  text += "\nOptions:\n";
  for (const Setting& setting : settings) {
    if (setting.is_secret) {
      text +=
          help_row(setting.variable, setting.help + "; also " + setting.key + " = … in the file");
      continue;
    }
    const std::string value = setting.is_switch ? "" : " " + setting.placeholder;
    const std::string now = setting.write();
    const bool has_default = !setting.is_switch && !now.empty();
    text +=
        help_row("--" + setting.key + value, setting.help + (has_default ? " [" + now + "]" : ""));
  }
  text += help_row("--dump-config", "Print the configuration in force, as --config takes it");
  text += help_row("--help, -h", "Print this");
  text += help_row("--version", "Print the version");
  text += "\nAn option --some-key can also stand in the environment, as " +
          variable_for("some-key", false) +
          " (RTPM_SOME_KEY\n"
          "if several programs have it; --dump-config tells), and in the file, as 'some-key = "
          "value'. A\n"
          "flag wins over the environment, the environment over the file.\n";
  return text;
}

std::string Options::Impl::dump_text() {
  std::string text = "# " + name + " " RTPM_VERSION ": the configuration in force.\n";
  // Every program reads these, see runtime/transport and runtime/access.
  std::vector<std::string> variables{"RTPM_RUNTIME_FOLDER", "RTPM_KEYS"};
  for (std::size_t i = 0; i < settings.size(); ++i) {
    const Setting& setting = settings[i];
    variables.push_back(setting.variable);
    if (setting.key == kConfigKey) continue;
    text += "\n# " + setting.help + " [" + setting.variable + "] (" + sources[i] + ")\n";
    // So the text can be kept and passed on; --config then leaves the secret as it is.
    text += setting.is_secret ? "# " + setting.key + " = (a secret, not printed)\n"
                              : setting.key + " = " + config_value_text(setting.write()) + "\n";
  }
  for (char** variable = environ; *variable != nullptr; ++variable) {
    const std::string_view entry = *variable;
    const std::string variable_name(entry.substr(0, entry.find('=')));
    if (variable_name.starts_with(kVariablePrefix) &&
        std::find(variables.begin(), variables.end(), variable_name) == variables.end()) {
      const auto meant = std::ranges::find_if(settings, [&](const Setting& setting) {
        return variable_of(setting.key) == variable_name;
      });
      text += "\n# " + variable_name + " in the environment is no key of this program" +
              (meant == settings.end() ? "" : ", which has " + meant->variable) + ".\n";
    }
  }
  return text;
}

Options::Options(std::string name, std::string description)
    : impl_(new Impl{.name = std::move(name), .description = std::move(description)}) {
  const Shared shared(*this);
  impl_->add(std::string(kConfigKey), "Read options from FILE, one 'key = value' a line",
             setting_of(impl_->config_path));
  impl_->settings.back().placeholder = "FILE";
  impl_->settings.back().expected = "the path of a file";
}
Options::~Options() = default;

Options::Shared::Shared(Options& options) noexcept
    : options_(options), was_shared_(std::exchange(options.impl_->is_shared, true)) {}
Options::Shared::~Shared() {
  options_.impl_->is_shared = was_shared_;
}

void Options::add(std::string key, std::string& value, std::string help) {
  impl_->add(std::move(key), std::move(help), setting_of(value));
}
void Options::add(std::string key, bool& value, std::string help) {
  impl_->add(std::move(key), std::move(help), setting_of(value));
}
void Options::add(std::string key, int& value, std::string help, Range<int> range) {
  impl_->add(std::move(key), std::move(help), setting_of(value, range));
}
void Options::add(std::string key, std::uint16_t& value, std::string help,
                  Range<std::uint16_t> range) {
  impl_->add(std::move(key), std::move(help), setting_of(value, range));
}
void Options::add(std::string key, std::uint64_t& value, std::string help,
                  Range<std::uint64_t> range) {
  impl_->add(std::move(key), std::move(help), setting_of(value, range));
}
void Options::add(std::string key, double& value, std::string help, Range<double> range) {
  impl_->add(std::move(key), std::move(help), setting_of(value, range));
}
void Options::add(std::string key, Duration& value, std::string help, Range<Duration> range) {
  impl_->add(std::move(key), std::move(help), setting_of(value, range));
}
void Options::add(std::string key, Priority& value, std::string help) {
  impl_->add(std::move(key), std::move(help), setting_of(value));
}
void Options::add(std::string key, std::vector<std::string>& value, std::string help) {
  impl_->add(std::move(key), std::move(help), setting_of(value));
}
void Options::add(std::string key, std::vector<int>& value, std::string help) {
  impl_->add(std::move(key), std::move(help), setting_of(value));
}
void Options::add_off_or_time(std::string key, std::optional<Duration>& value, std::string help,
                              Range<Duration> range) {
  impl_->add(std::move(key), std::move(help), setting_of(value, range));
}
void Options::add(std::string key, std::uint32_t& value, std::string help,
                  Range<std::uint32_t> range) {
  impl_->add(std::move(key), std::move(help), setting_of(value, range));
}

void Options::add_choice(std::string key, std::string& value,
                         const std::vector<std::string>& choices, std::string help) {
  impl_->add(
      std::move(key), std::move(help),
      setting_of_choice(
          choices, [&value](std::string_view word) { value = word; }, [&value] { return value; }));
}

void Options::add_secret(std::string key, std::string& value, std::string help,
                         const std::string& file) {
  impl_->add(std::move(key), std::move(help), setting_of(value));
  Setting& setting = impl_->settings.back();
  setting.is_secret = true;
  setting.expected = "in " + setting.variable + ", or in " + file;
}

void Options::add_positional(std::string name, std::string& value, std::string help,
                             Presence presence) {
  Setting setting = setting_of(value);
  setting.help = std::move(help);
  impl_->positionals.push_back({std::move(name), std::move(setting), presence});
}

void Options::add_positional(std::string name, std::vector<std::string>& value, std::string help,
                             Presence presence) {
  Setting setting = setting_of(value);
  setting.help = std::move(help);
  // The first given item replaces the default.
  setting.read = [&value, is_default = true](std::string_view text) mutable {
    if (std::exchange(is_default, false)) value.clear();
    value.emplace_back(text);
    return true;
  };
  impl_->positionals.push_back({std::move(name), std::move(setting), presence});
}

void Options::add_verb(std::string name, std::string arguments, std::string help,
                       std::string details) {
  impl_->verbs.push_back(
      {std::move(name), std::move(arguments), std::move(help), std::move(details)});
}

void Options::add_realtime(rt::RealtimeMode& mode) {
  const Shared shared(*this);
  using enum rt::RealtimeMode;
  impl_->add("realtime", "What to do where the system refuses real-time scheduling",
             enum_setting(mode, std::array{kPrefer, kRequire, kOff}));
}

void Options::add_wait(rt::WaitConfig& wait, const std::string& prefix) {
  const Shared shared(*this);
  using enum rt::WaitStrategy;
  impl_->add(prefix + "wait",
             "How to wait for traffic: spin a while and then block, block, or spin",
             enum_setting(wait.strategy, std::array{kAdaptive, kPeriodic, kBlock, kSpin}));
  impl_->add(prefix + "spin", "How long an adaptive wait spins before it blocks",
             setting_of(wait.spin, {Duration{0}, std::chrono::seconds{1}}));
}

void Options::add_schedule(std::string key, rt::Schedule& schedule, std::string help) {
  using enum rt::Schedule;
  impl_->add(std::move(key), std::move(help),
             enum_setting(schedule, std::array{kFifo, kTimeShared}));
}

void Options::add_group(std::string key, std::vector<std::string>& names, std::string help,
                        std::size_t size_max,
                        std::function<void(const std::vector<std::string>&)> add_members) {
  impl_->groups.push_back({key, impl_->is_shared, &names, std::move(add_members)});
  impl_->add(std::move(key), std::move(help), setting_of_names(names, size_max));
}

void Options::add_registry(std::string& where) {
  const Shared shared(*this);
  const bool is_url = where.find("://") != std::string::npos;
  impl_->names_place = {&where, is_url ? where : "", is_url ? "host" : where};
  add("registry", impl_->names_place.registry,
      "The registry of names, and no other; several with the same names: URL,URL; empty: where "
      "--discover finds one");
  impl_->settings.back().placeholder = "URL";
  impl_->settings.back().expected = "a URL, rtpm://host:port/path";
  add("discover", impl_->names_place.discover,
      "Without --registry, where to find names: host, this one only; lan[:DOMAIN]@INTERFACE, also "
      "the LAN by multicast; or hosts, HOST[:PORT],…");
  impl_->settings.back().placeholder = "HOW";
}

std::optional<int> Options::parse(int argc, const char* const* argv) {
  const std::vector<std::string_view> arguments(argv + std::min(argc, 1), argv + argc);
  impl_->add_members(arguments);
  const auto command_line = parse_command_line(arguments, impl_->settings);
  if (!command_line) return usage_error(command_line.error().reason());
  const auto verb = impl_->verb_in(*command_line);
  if (!verb) return usage_error(verb.error().reason());
  if (command_line->wants_help || command_line->wants_version) {
    const std::string text =
        command_line->wants_help ? impl_->help_text(*verb) : impl_->name + " " RTPM_VERSION "\n";
    std::fputs(text.c_str(), stdout);
    return 0;
  }
  if (const auto applied = impl_->apply_all(*command_line); !applied) {
    return usage_error(applied.error().reason());
  }
  if (impl_->names_place.where != nullptr) *impl_->names_place.where = impl_->names_place.chosen();
  if (command_line->wants_dump) {
    std::fputs(impl_->dump_text().c_str(), stdout);
    return 0;
  }
  if (const auto applied = impl_->apply_positionals(*command_line); !applied) {
    return usage_error(applied.error().reason());
  }
  return std::nullopt;
}

int Options::usage_error_of_verb(std::string_view verb) const {
  const auto found = std::ranges::find(impl_->verbs, verb, &Verb::name);
  RTPM_ASSERT(found != impl_->verbs.end(), "the verb was added");
  const std::string whole = impl_->name + ' ' + found->name;
  rt::print_error(impl_->name, "usage: " + impl_->name + ' ' + found->form() + "; run '" + whole +
                                   " --help' for what it takes");
  return 2;
}

int Options::usage_error(std::string_view what) const {
  rt::print_error(impl_->name,
                  std::string(what) + "; run '" + impl_->name + " --help' for what there is");
  return 2;
}

}  // namespace rtpm::options
