#include "rtpm/options/options.hpp"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <CLI/CLI.hpp>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <map>
#include <utility>

#include "config_file.hpp"
#include "rtpm/base/assert.hpp"
#include "rtpm/program/text.hpp"
#include "rtpm/rt/log.hpp"
#include "setting.hpp"

namespace rtpm::options {
namespace {

constexpr const char* kLetters = "abcdefghijklmnopqrstuvwxyz0123456789-";
constexpr const char* kConfigFlag = "--config";
constexpr const char* kConfigVariable = "RTPM_CONFIG";

/// The flags that were given, each with its values.
struct CommandLine {
  std::map<std::string, Texts> values{};
  bool wants_help = false;
  bool wants_all_help = false;
  bool wants_version = false;
  bool wants_dump = false;
};

std::string variable_of(std::string_view key) {
  std::string variable = "RTPM_";
  for (const char c : key) {
    const bool is_lower = c >= 'a' && c <= 'z';
    variable += c == '-' || c == '.' ? '_' : static_cast<char>(is_lower ? c - 'a' + 'A' : c);
  }
  return variable;
}

/// An option whose values are an enum's names.
template <class Enum, std::size_t Count>
Setting enum_setting(Enum& value, const std::array<Enum, Count>& values) {
  Texts words;
  for (const Enum candidate : values)
    words.emplace_back(to_string(candidate));
  return setting_of_choice(
      words,
      [&value, values](std::string_view word) {
        value = *std::ranges::find(values, word, [](Enum each) { return to_string(each); });
      },
      [&value] { return std::string(to_string(value)); });
}

/// `text` in lines that fit behind the flags of --help.
std::string in_lines(std::string text) {
  constexpr std::size_t kWidth = 68;
  for (std::size_t begin = 0; text.size() - begin > kWidth;) {
    const std::size_t blank = text.rfind(' ', begin + kWidth);
    if (blank == text.npos || blank <= begin) break;
    text[blank] = '\n';
    begin = blank + 1;
  }
  return text;
}

/// A negative number, and "-" for a standard stream, are not flags.
bool is_flag(std::string_view argument) {
  return argument.size() > 1 && argument.front() == '-' &&
         std::string_view("0123456789.").find(argument[1]) == std::string_view::npos;
}

/// The values of a flag before all flags are known, for options that add others.
Texts early_values(const Texts& arguments, const std::string& flag) {
  Texts values;
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    if (arguments[i] == flag && i + 1 < arguments.size()) values.push_back(arguments[i + 1]);
    if (arguments[i].starts_with(flag + "="))
      values.push_back(arguments[i].substr(flag.size() + 1));
  }
  return values;
}

}  // namespace

/// The place of added options.
struct Options::Place {
  Texts tables{};        ///< In the file.
  std::string prefix{};  ///< Stands before a key in its flag: "device-arm0-".
  bool is_shared = false;
  bool is_rare = false;
};

/// A list of names, each with options of its own.
struct Options::Group {
  std::size_t setting;
  Place place;
  std::string table;
  std::vector<std::string>* names;
  std::function<void(const std::vector<std::string>&)> add_members;
};

struct Options::Impl {
  /// The place of names: the registry's URL or, without one, how to find them.
  struct NamesPlace {
    std::string* where = nullptr;  ///< Null if the program has no use for them.
    std::string registry{};
    std::string discover{};
  };

  std::string name;
  std::string description;
  std::vector<Setting> settings{};
  std::vector<Group> groups{};
  NamesPlace names_place{};
  Place place{};
  std::string config{};
  expected<std::vector<ConfigEntry>, SetupError> file{std::vector<ConfigEntry>{}};

  /// "RTPM_SERVO_RATE", or "RTPM_REGISTRY".
  [[nodiscard]] std::string variable_for(const std::string& key) const {
    const std::string own = name.starts_with("rtpm-") ? name.substr(5) : name;
    return variable_of(place.is_shared ? key : own + "-" + key);
  }

  Setting& add(const std::string& key, std::string help, Setting setting) {
    RTPM_ASSERT(!key.empty() && key.find_first_not_of(kLetters) == key.npos,
                "a key is of lower-case letters, digits and '-'");
    setting.flag = "--" + place.prefix + key;
    RTPM_ASSERT(std::ranges::find(settings, setting.flag, &Setting::flag) == settings.end() &&
                    key != "help" && key != "help-all" && key != "version" && key != "dump-config",
                "the key is already in use");
    setting.variable = variable_for(place.prefix + key);
    setting.path = place.tables;
    setting.path.push_back(key);
    setting.is_rare = place.is_rare;
    setting.help = std::move(help);
    return settings.emplace_back(std::move(setting));
  }

  void read_file(const Texts& arguments);
  /// The value of a setting before all flags are known. Errors in it are reported later.
  [[nodiscard]] std::optional<Texts> early_texts(const Setting& setting,
                                                 const Texts& arguments) const;
  void add_members(const Texts& arguments);
  void add_names_of_tables(const Group& group) const;
  expected<CommandLine, SetupError> read_command_line(const Texts& arguments, CLI::App& app) const;
  expected<void, SetupError> apply(const CommandLine& command_line);
  expected<void, SetupError> apply_file();
  [[nodiscard]] std::string help(CLI::App& app, bool is_all) const;
  [[nodiscard]] std::string dump() const;
};

namespace {

/// Sets the variable; `origin` locates the text in messages, `source` in --dump-config.
expected<void, SetupError> set(Setting& setting, const Texts& texts, const std::string& origin,
                               const std::string& source) {
  if (!setting.read(texts)) {
    return unexpected{
        SetupError{origin + " '" + program::joined(texts, ",") + "' is not " + setting.expected}};
  }
  setting.source = source;
  return {};
}

SetupError refusal_of_secret(const Setting& setting) {
  return {setting.flag +
          " would show it to all users of this host, who can read command lines; give it " +
          setting.expected};
}

/// Splits `--key=value`, which CLI11 takes for `--key` if the value is empty, and refuses a flag
/// without its value, which CLI11 would give the next flag.
expected<Texts, SetupError> with_values_apart(const Texts& arguments,
                                              const std::vector<Setting>& settings) {
  Texts apart;
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    const std::string& argument = arguments[i];
    const std::size_t equals = std::min(argument.find('='), argument.size());
    const auto setting = std::ranges::find(settings, argument.substr(0, equals), &Setting::flag);
    if (setting != settings.end() && setting->is_secret)
      return unexpected{refusal_of_secret(*setting)};
    if (setting == settings.end() || setting->is_switch) {
      apart.push_back(argument);
    } else if (equals < argument.size()) {
      apart.insert(apart.end(), {setting->flag, argument.substr(equals + 1)});
    } else if (i + 1 < arguments.size() && !is_flag(arguments[i + 1])) {
      apart.insert(apart.end(), {setting->flag, arguments[++i]});
    } else {
      return unexpected{SetupError{setting->flag + " needs a value: " + setting->expected}};
    }
  }
  return apart;
}

SetupError unknown(const std::string& argument, const CLI::App& app) {
  if (!is_flag(argument)) return {"unexpected argument '" + argument + "'"};
  Texts flags;
  for (const CLI::Option* option : app.get_options())
    flags.push_back("--" + option->get_lnames().front());
  const std::string flag = argument.substr(0, argument.find('='));
  return {"unknown flag '" + flag + "'" + program::suggestion(flag, flags)};
}

}  // namespace

expected<CommandLine, SetupError> Options::Impl::read_command_line(const Texts& arguments,
                                                                   CLI::App& app) const {
  CommandLine result;
  app.set_help_flag();
  app.allow_extras();
  for (const Setting& setting : settings) {
    if (setting.is_secret) continue;
    CLI::Option* const option =
        setting.is_switch
            ? app.add_flag(setting.flag)
            : app.add_option(setting.flag, [](const CLI::results_t&) { return true; });
    option->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  }
  app.add_flag("--dump-config", result.wants_dump,
               "Print the configuration in force, as --config takes it");
  app.add_flag("-h,--help", result.wants_help, "Print this");
  app.add_flag("--help-all", result.wants_all_help, "Print all options");
  app.add_flag("--version", result.wants_version, "Print the version");
  auto apart = with_values_apart(arguments, settings);
  if (!apart) return unexpected{apart.error()};
  std::ranges::reverse(*apart);  // CLI11 takes them from the end.
  try {
    app.parse(*apart);
  } catch (const CLI::ParseError& error) {
    return unexpected{SetupError{error.what()}};
  }
  if (const Texts rest = app.remaining(); !rest.empty())
    return unexpected{unknown(rest.front(), app)};
  for (const Setting& setting : settings) {
    if (setting.is_secret || app.count(setting.flag) == 0) continue;
    const Texts& given = app.get_option(setting.flag)->results();
    if (given.size() > 1 && !setting.is_list)
      return unexpected{SetupError{setting.flag + " is given twice"}};
    result.values[setting.flag] = given;
  }
  return result;
}

void Options::Impl::read_file(const Texts& arguments) {
  const Texts given = early_values(arguments, kConfigFlag);
  const char* const variable = std::getenv(kConfigVariable);
  if (!given.empty() || variable != nullptr)
    file = read_config_file(given.empty() ? variable : given.front());
}

std::optional<Texts> Options::Impl::early_texts(const Setting& setting,
                                                const Texts& arguments) const {
  if (const Texts values = early_values(arguments, setting.flag); !values.empty())
    return texts_of(setting, program::joined(values, ","));
  if (const char* const text = std::getenv(setting.variable.c_str()))
    return texts_of(setting, text);
  if (!file) return std::nullopt;
  const auto entry = std::ranges::find(*file, setting.path, &ConfigEntry::path);
  return entry == file->end() ? std::nullopt : std::optional(entry->texts);
}

void Options::Impl::add_members(const Texts& arguments) {
  for (const Group& group : std::exchange(groups, {})) {
    const Setting& setting = settings[group.setting];
    if (const auto texts = early_texts(setting, arguments)) {
      static_cast<void>(setting.read(*texts));
    } else if (file) {
      add_names_of_tables(group);
    }
    place = group.place;
    group.add_members(*group.names);
    place = {};
  }
}

void Options::Impl::add_names_of_tables(const Group& group) const {
  for (const ConfigEntry& entry : *file) {
    if (entry.is_table && entry.path.size() == 2 && entry.path.front() == group.table &&
        std::ranges::find(*group.names, entry.path.back()) == group.names->end())
      group.names->push_back(entry.path.back());
  }
}

expected<void, SetupError> Options::Impl::apply_file() {
  if (!file) return unexpected{file.error()};
  for (const ConfigEntry& entry : *file) {
    const auto setting = std::ranges::find(settings, entry.path, &Setting::path);
    if (setting == settings.end() || setting->flag == kConfigFlag) {
      if (entry.is_table && std::ranges::any_of(settings, [&](const Setting& each) {
            return std::ranges::mismatch(entry.path, each.path).in1 == entry.path.end();
          }))
        continue;
      Texts keys;
      for (const Setting& candidate : settings)
        keys.push_back(key_text(candidate.path));
      const std::string key = key_text(entry.path);
      return unexpected{
          SetupError{entry.place + ": unknown key '" + key + "'" + program::suggestion(key, keys)}};
    }
    const std::string origin = entry.place + ": " + key_text(entry.path);
    if (entry.is_table) return unexpected{SetupError{origin + " is a table"}};
    if (auto done = set(*setting, entry.texts, origin, entry.place); !done) return done;
  }
  return {};
}

expected<void, SetupError> Options::Impl::apply(const CommandLine& command_line) {
  if (auto done = apply_file(); !done) return done;
  for (Setting& setting : settings) {
    const auto given = command_line.values.find(setting.flag);
    const char* const text = std::getenv(setting.variable.c_str());
    // A variable that a flag overrides is not read.
    if (given != command_line.values.end()) {
      const Texts texts = texts_of(setting, program::joined(given->second, ","));
      if (auto done = set(setting, texts, setting.flag, setting.flag); !done) return done;
    } else if (text != nullptr) {
      if (auto done = set(setting, texts_of(setting, text), setting.variable, setting.variable);
          !done)
        return done;
    }
  }
  if (names_place.where != nullptr)
    *names_place.where = names_place.registry.empty() ? names_place.discover : names_place.registry;
  return {};
}

std::string Options::Impl::help(CLI::App& app, bool is_all) const {
  std::string secrets;
  for (const Setting& setting : settings) {
    if (setting.is_secret) {
      secrets += "  " + setting.variable + "  " + setting.help + "; also " +
                 key_text(setting.path) + " = … in the file\n";
      continue;
    }
    CLI::Option& option = *app.get_option(setting.flag);
    const std::string now = setting.is_switch ? "" : program::joined(setting.write(), ",");
    option.description(in_lines(setting.help + (now.empty() ? "" : " [" + now + "]")));
    option.type_name(setting.placeholder);
    if (setting.is_rare && !is_all) option.group("");
  }
  app.footer((secrets.empty() ? "" : "Secrets:\n" + secrets + "\n") +
             "An option --some-key can also stand in the environment, as " +
             variable_for("some-key") +
             " (RTPM_SOME_KEY\nif several programs have it; --dump-config tells), and in a TOML "
             "file, as some-key = value. A\nflag wins over the environment, the environment over "
             "the file." +
             (is_all ? "" : " --help-all shows all options."));
  return app.help();
}

std::string Options::Impl::dump() const {
  std::string text = "# " + name + " " RTPM_VERSION ": the configuration in force.\n";
  // Every program reads these, see runtime/transport and runtime/access.
  Texts variables{"RTPM_RUNTIME_FOLDER", "RTPM_KEYS"};
  std::vector<Texts> tables{Texts{}};  // In TOML, the keys outside of tables come first.
  for (const Setting& setting : settings) {
    variables.push_back(setting.variable);
    const Texts table(setting.path.begin(), setting.path.end() - 1);
    if (std::ranges::find(tables, table) == tables.end()) tables.push_back(table);
  }
  for (const Texts& table : tables) {
    if (!table.empty()) text += "\n[" + key_text(table) + "]\n";
    for (const Setting& setting : settings) {
      if (setting.flag == kConfigFlag ||
          !std::ranges::equal(table, std::span(setting.path).first(setting.path.size() - 1)))
        continue;
      Texts values = setting.write();
      if (setting.is_text) std::ranges::transform(values, values.begin(), quoted);
      const std::string value =
          setting.is_list ? "[" + program::joined(values) + "]" : values.front();
      text += "\n# " + setting.help + " [" + setting.variable + "] (" + setting.source + ")\n";
      // So the text can be kept and passed on; --config then leaves the secret as it is.
      text += setting.is_secret ? "# " + setting.path.back() + " = (a secret, not printed)\n"
                                : setting.path.back() + " = " + value + "\n";
    }
  }
  for (char** variable = environ; *variable != nullptr; ++variable) {
    const std::string entry = *variable;
    const std::string other = entry.substr(0, entry.find('='));
    if (!other.starts_with("RTPM_") || std::ranges::find(variables, other) != variables.end())
      continue;
    const auto meant = std::ranges::find_if(settings, [&](const Setting& setting) {
      return variable_of(setting.flag.substr(2)) == other;
    });
    text += "\n# " + other + " in the environment is no key of this program" +
            (meant == settings.end() ? "" : ", which has " + meant->variable) + ".\n";
  }
  return text;
}

Options::Options(std::string name, std::string description)
    : impl_(new Impl{.name = std::move(name), .description = std::move(description)}) {
  const Scope scope = Scope::of_all_programs(*this);
  Setting& config =
      impl_->add("config", "Read options from this TOML file", setting_of(impl_->config));
  config.placeholder = "FILE";
  config.expected = "the path of a file";
}
Options::~Options() = default;

Options::Scope::Scope(Options& options, Place place)
    : options_(options),
      former_(std::make_unique<Place>(std::exchange(options.impl_->place, std::move(place)))) {}
Options::Scope::~Scope() {
  options_.impl_->place = std::move(*former_);
}
Options::Scope Options::Scope::of_rare(Options& options) {
  Place place = options.impl_->place;
  place.is_rare = true;
  return {options, place};
}
Options::Scope Options::Scope::of_all_programs(Options& options, const std::string& table) {
  Place place = options.impl_->place;
  place.is_shared = true;
  if (!table.empty()) place.tables = {table};
  return {options, place};
}
Options::Scope Options::Scope::of_member(Options& options, const std::string& table,
                                         const std::string& name) {
  const bool is_shared = options.impl_->place.is_shared;
  return {options, Place{{table, name}, table + "-" + name + "-", is_shared, true}};
}

void Options::add(const std::string& key, std::string& value, std::string help) {
  impl_->add(key, std::move(help), setting_of(value));
}
void Options::add(const std::string& key, bool& value, std::string help) {
  impl_->add(key, std::move(help), setting_of(value));
}
void Options::add(const std::string& key, std::vector<std::string>& value, std::string help) {
  impl_->add(key, std::move(help), setting_of(value));
}
void Options::add(const std::string& key, std::vector<int>& value, std::string help) {
  impl_->add(key, std::move(help), setting_of(value));
}
template <class T>
void Options::add(const std::string& key, T& value, std::string help, Range<T> range) {
  impl_->add(key, std::move(help), setting_of(value, range));
}
template void Options::add(const std::string&, int&, std::string, Range<int>);
template void Options::add(const std::string&, std::uint16_t&, std::string, Range<std::uint16_t>);
template void Options::add(const std::string&, std::uint32_t&, std::string, Range<std::uint32_t>);
template void Options::add(const std::string&, std::uint64_t&, std::string, Range<std::uint64_t>);
template void Options::add(const std::string&, double&, std::string, Range<double>);
template void Options::add(const std::string&, Duration&, std::string, Range<Duration>);
template void Options::add(const std::string&, Priority&, std::string, Range<Priority>);

void Options::add_off_or_time(const std::string& key, std::optional<Duration>& value,
                              std::string help) {
  impl_->add(key, std::move(help), setting_of(value, {}));
}

void Options::add_choice(const std::string& key, std::string& value,
                         const std::vector<std::string>& choices, std::string help) {
  impl_->add(key, std::move(help),
             setting_of_choice(
                 choices, [&value](const std::string& word) { value = word; },
                 [&value] { return value; }));
}

void Options::add_secret(const std::string& key, std::string& value, std::string help,
                         const std::string& file) {
  Setting& setting = impl_->add(key, std::move(help), setting_of(value));
  setting.is_secret = true;
  setting.expected = "in " + setting.variable + ", or in " + file;
}

void Options::add_realtime(rt::RealtimeMode& mode) {
  const Scope scope = Scope::of_all_programs(*this);
  const Scope rare = Scope::of_rare(*this);
  using enum rt::RealtimeMode;
  impl_->add("realtime", "What to do where the system refuses real-time scheduling",
             enum_setting(mode, std::array{kPrefer, kRequire, kOff}));
}

void Options::add_wait(rt::WaitConfig& wait) {
  const Scope scope = Scope::of_all_programs(*this);
  const Scope rare = Scope::of_rare(*this);
  using enum rt::WaitStrategy;
  impl_->add("wait", "How to wait for traffic: spin a while and then block, block, or spin",
             enum_setting(wait.strategy, std::array{kAdaptive, kPeriodic, kBlock, kSpin}));
  add("spin", wait.spin, "How long an adaptive wait spins before it blocks",
      {Duration{0}, std::chrono::seconds{1}});
}

void Options::add_schedule(const std::string& key, rt::Schedule& schedule, std::string help) {
  using enum rt::Schedule;
  impl_->add(key, std::move(help), enum_setting(schedule, std::array{kFifo, kTimeShared}));
}

void Options::add_group(const std::string& key, std::string table, std::vector<std::string>& names,
                        std::string help, std::size_t size_max,
                        std::function<void(const std::vector<std::string>&)> add_members) {
  impl_->add(key, std::move(help), setting_of_names(names, size_max));
  impl_->groups.push_back(
      {impl_->settings.size() - 1, impl_->place, std::move(table), &names, std::move(add_members)});
}

void Options::add_registry(std::string& where) {
  const Scope scope = Scope::of_all_programs(*this);
  Impl::NamesPlace& place = impl_->names_place;
  const bool is_url = where.find("://") != std::string::npos;
  place = {&where, is_url ? where : "", is_url ? "host" : where};
  Setting& registry = impl_->add(
      "registry",
      "The registry of names, and no other; several with the same names: URL,URL; empty: where "
      "--discover finds one",
      setting_of(place.registry));
  registry.placeholder = "URL";
  registry.expected = "a URL, rtpm://host:port/path";
  impl_
      ->add("discover",
            "Without --registry, where to find names: host, this one only; "
            "lan[:DOMAIN]@INTERFACE, also the LAN by multicast; or hosts, HOST[:PORT],…",
            setting_of(place.discover))
      .placeholder = "HOW";
}

std::optional<int> Options::parse(int argc, const char* const* argv) {
  const Texts arguments(argv + std::min(argc, 1), argv + argc);
  impl_->read_file(arguments);
  impl_->add_members(arguments);
  CLI::App app(impl_->name + ": " + impl_->description, impl_->name);
  const auto command_line = impl_->read_command_line(arguments, app);
  if (!command_line) return usage_error(command_line.error().reason());
  std::string text;
  if (command_line->wants_help || command_line->wants_all_help) {
    text = impl_->help(app, command_line->wants_all_help);
  } else if (command_line->wants_version) {
    text = impl_->name + " " RTPM_VERSION "\n";
  } else if (const auto applied = impl_->apply(*command_line); !applied) {
    return usage_error(applied.error().reason());
  } else if (command_line->wants_dump) {
    text = impl_->dump();
  } else {
    return std::nullopt;
  }
  std::fputs(text.c_str(), stdout);
  return 0;
}

int Options::usage_error(std::string_view what) const {
  rt::print_error(impl_->name,
                  std::string(what) + "; run '" + impl_->name + " --help' for what there is");
  return 2;
}

}  // namespace rtpm::options
