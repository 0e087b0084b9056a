#include "rtpm/options/options.hpp"

#include <algorithm>
#include <cstdio>
#include <set>
#include <span>
#include <utility>

#include "config_file.hpp"
#include "os/environment.hpp"
#include "rtpm/rt/log.hpp"
#include "rtpm/wire/url.hpp"
#include "setting.hpp"

namespace rtpm::options {
namespace {

constexpr const char* kFurther = "Further options";
constexpr const char* kBare = "abcdefghijklmnopqrstuvwxyz0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZ_-";

std::string variable_of(const std::string& key) {
  std::string variable = "RTPM_";
  for (const char c : key) {
    const bool is_lower = c >= 'a' && c <= 'z';
    variable += c == '-' || c == '.' ? '_' : static_cast<char>(is_lower ? c - 'a' + 'A' : c);
  }
  return variable;
}

/// The items of lists with commas. CLI11's own delimiter would take the next argument for "--list ,".
Texts items_of(const Texts& lists) {
  Texts items;
  for (const std::string& list : lists) {
    std::size_t begin = 0;
    for (std::size_t end = 0; end != list.npos; begin = end + 1) {
      end = list.find(',', begin);
      items.push_back(CLI::detail::trim_copy(list.substr(begin, end - begin)));
    }
  }
  return items;
}

bool are_names(const Texts& names, std::size_t size_max) {
  std::set<std::string> variables;
  return !names.empty() && std::ranges::all_of(names, [&](const std::string& name) {
    return !name.empty() && name.size() <= size_max &&
           name.find_first_not_of(std::string(kBare) + '.') == name.npos &&
           variables.insert(variable_of(name)).second;
  });
}

/// `text` in quotes, as TOML has it.
std::string quoted(const std::string& text) {
  std::string written = "\"";
  for (const char letter : text) {
    if (static_cast<unsigned char>(letter) < 0x20 || letter == 0x7f) {
      written += program::formatted("\\u%04x", static_cast<unsigned>(letter));
    } else {
      if (letter == '"' || letter == '\\') written += '\\';
      written += letter;
    }
  }
  return written + '"';
}

/// "device.\"left.arm\".rate"
std::string key_text(std::span<const std::string> path) {
  Texts keys;
  for (const std::string& key : path) {
    const bool is_bare = !key.empty() && key.find_first_not_of(kBare) == key.npos;
    keys.push_back(is_bare ? key : quoted(key));
  }
  return program::joined(keys, ".");
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

}  // namespace

struct Options::Impl {
  /// A list of names, each with options of its own.
  struct Group {
    std::size_t setting;
    std::string table;
    std::vector<std::string>* names;
    std::function<void(const std::vector<std::string>&)> add_members;
  };

  Impl(const std::string& program, const std::string& description)
      : name(program), app(program + ": " + description, program) {
    app.set_help_flag();
    app.allow_extras();
    app.add_flag("-h,--help", wants_help, "Print this");
    app.add_flag("--help-all", wants_all_help, "Print all options");
    app.add_flag("--version", wants_version, "Print the version");
    app.add_option("--config", config, "Read options from this TOML file")
        ->envname("RTPM_CONFIG")
        ->type_name("FILE");
    app.add_flag("--dump-config", wants_dump,
                 "Print the configuration in force, as --config takes it");
  }

  /// "RTPM_SERVO_RATE", or "RTPM_REGISTRY".
  [[nodiscard]] std::string variable_for(const std::string& key, bool is_shared) const {
    const std::string own = name.starts_with("rtpm-") ? name.substr(5) : name;
    return variable_of(is_shared ? key : own + "-" + key);
  }

  void fail(const std::string& reason) {
    if (failure.empty()) failure = reason;
  }

  /// Aborts if the key is in use, which CLI11 throws.
  Setting& add(const Place& place, const std::string& key, std::string help,
               Setting setting) noexcept {
    const std::string flag = "--" + place.prefix + key;
    const bool is_switch = setting.kind.empty();
    setting.option = is_switch ? app.add_flag(flag)
                               : app.add_option(flag, [](const CLI::results_t&) { return true; });
    setting.option->envname(variable_for(place.prefix + key, place.is_shared))
        ->type_name(setting.kind);
    if (setting.is_list) setting.option->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
    if (place.is_rare) setting.option->group(kFurther);
    setting.path = place.tables;
    setting.path.push_back(key);
    setting.help = std::move(help);
    return settings.emplace_back(std::move(setting));
  }

  /// Reads flags, and variables that no flag overrides.
  void read_command_line(const Texts& arguments) {
    Texts reversed;  // CLI11 takes them from the end.
    for (const std::string& argument : arguments) {
      // CLI11 takes "--key=" for "--key".
      const bool is_empty = argument.starts_with("--") && argument.find('=') == argument.size() - 1;
      reversed.push_back(is_empty ? argument.substr(0, argument.size() - 1) : argument);
      if (is_empty) reversed.emplace_back();
    }
    std::ranges::reverse(reversed);
    try {
      app.parse(reversed);
    } catch (const CLI::ParseError& error) {
      fail(error.what());
    }
  }

  /// Sets the variable; `origin` locates the text in messages, `source` in --dump-config.
  void set(Setting& setting, const Texts& texts, const std::string& origin,
           const std::string& source) {
    const std::string shown = setting.is_secret ? "" : " '" + program::joined(texts, ",") + "'";
    if (!setting.read(texts)) fail(origin + shown + " is not " + setting.expected);
    setting.source = source;
  }

  void apply_file() {
    if (!file) return fail(file.error().reason());
    for (const ConfigEntry& entry : *file) {
      const std::string key = key_text(entry.path);
      const auto setting = std::ranges::find(settings, entry.path, &Setting::path);
      if (setting != settings.end() && entry.is_table) {
        fail(entry.place + ": " + key + " is a table, not " + setting->expected);
      } else if (setting != settings.end()) {
        set(*setting, entry.texts, entry.place + ": " + key, entry.place);
      } else if (!entry.is_table || std::ranges::none_of(settings, [&](const Setting& each) {
                   return std::ranges::mismatch(entry.path, each.path).in1 == entry.path.end();
                 })) {
        Texts keys;
        for (const Setting& candidate : settings)
          keys.push_back(key_text(candidate.path));
        fail(entry.place + ": unknown key '" + key + "'" + program::suggestion(key, keys));
      }
    }
  }

  void apply() {
    apply_file();
    for (Setting& setting : settings) {
      const Texts& given = setting.option->results();
      if (given.empty()) continue;
      const Texts texts = setting.is_list ? items_of(given) : given;
      const bool is_flag = std::ranges::count(app.parse_order(), setting.option) > 0;
      const std::string source =
          is_flag ? setting.option->get_name() : setting.option->get_envname();
      if (is_flag && setting.is_secret) {
        fail(source + " would show it to all users of this host, who can read command lines; " +
             "give it in " + setting.option->get_envname() + ", or in the file of --config");
      } else if (is_flag && texts.front().starts_with("--")) {
        fail(source + " needs a value: " + setting.expected);
      } else {
        set(setting, texts, source, source);
      }
    }
    if (names_place != nullptr) *names_place = registry.empty() ? discover : registry;
  }

  void add_members() {
    for (const Group& group : std::exchange(groups, {})) {
      if (settings[group.setting].source == "default" && file) {
        for (const ConfigEntry& entry : *file) {
          if (entry.is_table && entry.path.size() == 2 && entry.path.front() == group.table &&
              std::ranges::find(*group.names, entry.path.back()) == group.names->end())
            group.names->push_back(entry.path.back());
        }
      }
      group.add_members(*group.names);
    }
  }

  void refuse_unknown_flags() {
    const Texts rest = app.remaining();
    if (rest.empty()) return;
    const std::string flag = rest.front().substr(0, rest.front().find('='));
    if (!flag.starts_with('-')) return fail("unexpected argument '" + flag + "'");
    Texts flags;
    for (const CLI::Option* option : app.get_options())
      flags.push_back("--" + option->get_lnames().front());
    fail("unknown flag '" + flag + "'" + program::suggestion(flag, flags));
  }

  [[nodiscard]] std::string help() {
    for (const Setting& setting : settings) {
      CLI::Option& option = *setting.option;
      const std::string now = setting.kind.empty() ? "" : program::joined(setting.write(), ",");
      option.description(in_lines(setting.is_secret ? option.get_envname() + ": " + setting.help
                                  : now.empty()     ? setting.help
                                                    : setting.help + " [" + now + "]"));
      option.envname("");
      if (option.get_group() == kFurther && !wants_all_help) option.group("");
    }
    app.footer("An option --some-key can also stand in the environment, as " +
               variable_for("some-key", false) +
               " (RTPM_SOME_KEY\nif several programs have it; --dump-config tells), and in a TOML "
               "file, as some-key = value. A\nflag wins over the environment, the environment over "
               "the file." +
               (wants_all_help ? "" : " --help-all shows all options."));
    return app.help();
  }

  [[nodiscard]] std::string dump() const {
    // Every program reads these, see runtime/transport and runtime/access.
    std::set<std::string> variables{"RTPM_CONFIG", "RTPM_RUNTIME_FOLDER", "RTPM_KEYS"};
    // Each table with its keys. In TOML, the keys outside of tables come first.
    std::vector<std::pair<std::string, std::string>> tables{
        {"", "# " + name + " " RTPM_VERSION ": the configuration in force.\n"}};
    for (const Setting& setting : settings) {
      variables.insert(setting.option->get_envname());
      const std::string table = key_text(std::span(setting.path).first(setting.path.size() - 1));
      auto section = std::ranges::find(tables, table, [](const auto& each) { return each.first; });
      if (section == tables.end())
        section = tables.insert(tables.end(), {table, "\n[" + table + "]\n"});
      Texts values = setting.write();
      if (!setting.is_bare) std::ranges::transform(values, values.begin(), quoted);
      std::string value = program::joined(values);
      if (setting.is_list) value = "[" + value + "]";
      // A dump can be kept and passed on; --config then leaves the secret as it is.
      section->second += "\n# " + setting.help + " [" + setting.option->get_envname() + "] (" +
                         setting.source + ")\n" + (setting.is_secret ? "# " : "") +
                         setting.path.back() + " = " +
                         (setting.is_secret ? "(a secret, not printed)" : value) + "\n";
    }
    std::string text;
    for (const auto& [table, keys] : tables)
      text += keys;
    for (const std::string& entry : os::environment()) {
      const std::string other = entry.substr(0, entry.find('='));
      if (other.starts_with("RTPM_") && !variables.contains(other))
        text += "\n# " + other + " in the environment is no key of this program.\n";
    }
    return text;
  }

  std::string name;
  CLI::App app;
  bool wants_help = false;
  bool wants_all_help = false;
  bool wants_version = false;
  bool wants_dump = false;
  std::string config{};
  std::vector<Setting> settings{};
  std::vector<Group> groups{};
  std::string* names_place = nullptr;  ///< Gets the registry or, without one, how to find names.
  std::string registry{};
  std::string discover{};
  expected<std::vector<ConfigEntry>, SetupError> file{std::vector<ConfigEntry>{}};
  std::string failure{};  ///< The first mistake; empty if there is none.
};

Options::Options(const std::string& name, const std::string& description)
    : impl_(std::make_shared<Impl>(name, description)) {}
Options::Options(const Options& whole, Place place)
    : impl_(std::shared_ptr<Impl>{}, whole.impl_.get()), place_(std::move(place)) {}

Options Options::rare() const {
  Place place = place_;
  place.is_rare = true;
  return {*this, std::move(place)};
}
Options Options::of_all_programs(const std::string& table) const {
  Place place = place_;
  place.is_shared = true;
  if (!table.empty()) place.tables = {table};
  return {*this, std::move(place)};
}
Options Options::of_member(const std::string& table, const std::string& name) const {
  return {*this, Place{{table, name}, table + "-" + name + "-", place_.is_shared, true}};
}

template <class T>
void Options::add(const std::string& key, T& value, std::string help, Range<T> range) {
  impl_->add(place_, key, std::move(help), setting_of(value, range));
}
template void Options::add(const std::string&, std::string&, std::string, Range<std::string>);
template void Options::add(const std::string&, bool&, std::string, Range<bool>);
template void Options::add(const std::string&, int&, std::string, Range<int>);
template void Options::add(const std::string&, std::uint16_t&, std::string, Range<std::uint16_t>);
template void Options::add(const std::string&, std::uint32_t&, std::string, Range<std::uint32_t>);
template void Options::add(const std::string&, std::uint64_t&, std::string, Range<std::uint64_t>);
template void Options::add(const std::string&, double&, std::string, Range<double>);
template void Options::add(const std::string&, Duration&, std::string, Range<Duration>);
template void Options::add(const std::string&, std::optional<Duration>&, std::string,
                           Range<std::optional<Duration>>);
template void Options::add(const std::string&, Priority&, std::string, Range<Priority>);
template void Options::add(const std::string&, rt::Schedule&, std::string, Range<rt::Schedule>);
template void Options::add(const std::string&, Texts&, std::string, Range<Texts>);
template void Options::add(const std::string&, std::vector<int>&, std::string,
                           Range<std::vector<int>>);

void Options::add_choice(const std::string& key, std::string& value, const Texts& choices,
                         std::string help) {
  impl_->add(place_, key, std::move(help), choice(value, choices));
}

void Options::add_secret(const std::string& key, std::string& value, std::string help) {
  Setting& setting = impl_->add(place_, key, std::move(help), setting_of(value, {}));
  setting.is_secret = true;
  setting.option->group("Secrets, in the environment or the file only");
}

void Options::add_realtime(rt::RealtimeMode& mode) {
  using enum rt::RealtimeMode;
  impl_->add(of_all_programs().rare().place_, "realtime",
             "What to do where the system refuses real-time scheduling",
             choice(mode, {kPrefer, kRequire, kOff}));
}

void Options::add_wait(rt::WaitConfig& wait) {
  using enum rt::WaitStrategy;
  Options rare = of_all_programs().rare();
  impl_->add(rare.place_, "wait",
             "How to wait for traffic: spin a while and then block, block, or spin",
             choice(wait.strategy, {kAdaptive, kPeriodic, kBlock, kSpin}));
  rare.add("spin", wait.spin, "How long an adaptive wait spins before it blocks",
           {Duration{0}, std::chrono::seconds{1}});
}

void Options::add_group(const std::string& key, const std::string& table, Texts& names,
                        std::string help, std::size_t size_max,
                        std::function<void(const Texts&)> add_members) {
  Setting setting = setting_of(names, {});
  setting.kind = "NAME,NAME";
  setting.expected = "a list of different names of letters, digits, '.', '_' and '-', of up to " +
                     number_text(size_max) + " bytes each";
  setting.read = [read = setting.read, size_max](const Texts& texts) {
    return are_names(texts, size_max) && read(texts);
  };
  impl_->add(place_, key, std::move(help), std::move(setting));
  impl_->groups.push_back({impl_->settings.size() - 1, table, &names, std::move(add_members)});
}

void Options::add_registry(std::string& where) {
  Options shared = of_all_programs();
  const bool is_url = where.find("://") != where.npos;
  impl_->names_place = &where;
  impl_->registry = is_url ? where : "";
  impl_->discover = is_url ? "host" : where;
  Setting setting = setting_of(impl_->registry, {});
  setting.expected = "a URL rtpm://host:port/path, or several with ',' between";
  setting.read = [read = setting.read](const Texts& texts) {
    return read(texts) && std::ranges::all_of(items_of(texts), [](const std::string& text) {
             return !wire::is_url(text) || wire::parse_url(text);
           });
  };
  impl_->add(
      shared.place_, "registry",
      "The registry of names, and no other: a URL rtpm://host:port/path; several with the same "
      "names: URL,URL; empty: where --discover finds one",
      std::move(setting));
  shared.add(
      "discover", impl_->discover,
      "Without --registry, where to find names: host, this one only; lan[:DOMAIN]@INTERFACE, also "
      "the LAN by multicast; or hosts, HOST[:PORT],…");
}

std::optional<int> Options::parse(int argc, const char* const* argv) {
  const Texts arguments(argv + std::min(argc, 1), argv + argc);
  Impl& its = *impl_;
  // The first time gives the file and the names of members, whose options the second time knows.
  its.read_command_line(arguments);
  if (!its.config.empty()) its.file = read_config_file(its.config);
  its.apply();
  its.add_members();
  its.failure.clear();
  its.read_command_line(arguments);
  its.refuse_unknown_flags();
  its.apply();
  std::string text;
  if (its.wants_help || its.wants_all_help) {
    text = its.help();
  } else if (its.wants_version) {
    text = its.name + " " RTPM_VERSION "\n";
  } else if (!its.failure.empty()) {
    return usage_error(its.failure);
  } else if (its.wants_dump) {
    text = its.dump();
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
