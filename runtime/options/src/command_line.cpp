#include "command_line.hpp"

#include <algorithm>
#include <optional>
#include <utility>

#include "rtpm/options/suggestion.hpp"

namespace rtpm::options {
namespace {

/// A negative number, and "-" for a standard stream, are not flags.
bool is_flag(std::string_view argument) {
  if (argument.size() < 2 || argument.front() != '-') return false;
  return std::string_view("0123456789.").find(argument[1]) == std::string_view::npos;
}

class Parser {
 public:
  Parser(const std::vector<std::string_view>& arguments, const std::vector<Setting>& settings)
      : arguments_(arguments), settings_(settings) {}

  expected<CommandLine, SetupError> run() {
    while (next_ < arguments_.size()) {
      const std::string_view argument = arguments_[next_++];
      if (argument == "--") break;
      if (!is_flag(argument)) {
        result_.positionals.emplace_back(argument);
      } else if (auto taken = take_flag(argument); !taken) {
        return unexpected{std::move(taken.error())};
      }
    }
    for (; next_ < arguments_.size(); ++next_)
      result_.positionals.emplace_back(arguments_[next_]);
    return std::move(result_);
  }

 private:
  expected<void, SetupError> take_flag(std::string_view argument) {
    if (bool* const flag = find_flag(argument)) {
      *flag = true;
      return {};
    }
    const std::size_t equals = argument.find('=');
    const std::string_view flag = argument.substr(0, equals);
    const Setting* const setting = find_setting(flag);
    if (setting == nullptr) return unexpected{unknown_flag(flag)};
    if (setting->is_secret) {
      return unexpected{SetupError{std::string(flag) +
                                   " would show it to all users of this host, who can read command "
                                   "lines; give it " +
                                   setting->expected}};
    }
    std::optional<std::string_view> value;
    if (equals != std::string_view::npos) {
      value = argument.substr(equals + 1);
    } else if (setting->is_switch) {
      value = "true";
    } else if (next_ < arguments_.size() && !is_flag(arguments_[next_])) {
      value = arguments_[next_++];
    }
    if (!value) {
      return unexpected{SetupError{std::string(flag) + " needs a value: " + setting->expected}};
    }
    return store(*setting, *value);
  }

  expected<void, SetupError> store(const Setting& setting, std::string_view value) {
    const auto [place, is_new] = result_.values.try_emplace(setting.key, value);
    if (is_new) return {};
    if (!setting.is_list) return unexpected{SetupError{"--" + setting.key + " is given twice"}};
    place->second.append(",").append(value);
    return {};
  }

  bool* find_flag(std::string_view argument) {
    if (argument == "--help" || argument == "-h") return &result_.wants_help;
    if (argument == "--version") return &result_.wants_version;
    if (argument == "--dump-config") return &result_.wants_dump;
    return nullptr;
  }

  const Setting* find_setting(std::string_view flag) const {
    if (!flag.starts_with("--")) return nullptr;
    const auto found =
        std::find_if(settings_.begin(), settings_.end(),
                     [&](const Setting& setting) { return setting.key == flag.substr(2); });
    return found == settings_.end() ? nullptr : &*found;
  }

  SetupError unknown_flag(std::string_view flag) const {
    std::vector<std::string> flags{"--help", "--version", "--dump-config"};
    for (const Setting& setting : settings_)
      flags.push_back("--" + setting.key);
    return {"unknown flag '" + std::string(flag) + "'" + suggestion(flag, flags)};
  }

  const std::vector<std::string_view>& arguments_;
  const std::vector<Setting>& settings_;
  std::size_t next_ = 0;
  CommandLine result_;
};

}  // namespace

expected<CommandLine, SetupError> parse_command_line(const std::vector<std::string_view>& arguments,
                                                     const std::vector<Setting>& settings) {
  return Parser(arguments, settings).run();
}

std::optional<std::string> early_flag(const std::string& flag,
                                      const std::vector<std::string_view>& arguments) {
  std::optional<std::string> text;
  for (std::size_t i = 0; i < arguments.size() && arguments[i] != "--"; ++i) {
    const std::string_view argument = arguments[i];
    std::string_view value;
    if (argument == flag && i + 1 < arguments.size()) {
      value = arguments[i + 1];
    } else if (argument.starts_with(flag + "=")) {
      value = argument.substr(flag.size() + 1);
    } else {
      continue;
    }
    text = text ? *text + "," + std::string(value) : std::string(value);
  }
  return text;
}

std::string suggestion(std::string_view word, const std::vector<std::string>& candidates) {
  const std::string candidate = nearest(word, candidates);
  return candidate.empty() ? "" : " (did you mean '" + candidate + "'?)";
}

}  // namespace rtpm::options
