#include "laboratory/plan.hpp"

#include <unistd.h>

#include <toml++/toml.h>
#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>
#include <regex>
#include <sstream>
#include <tuple>
#include <utility>

#include "rtpm/options/toml_limits.hpp"
#include "rtpm/program/duration.hpp"
#include "rtpm/program/text.hpp"

namespace rtpm::laboratory {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kProgramCountMax = 64;
constexpr const char* kNameForm =
    "' must be letters, digits, '-', '_' and '.', a letter or digit first, at most 32";
constexpr std::string_view kUrl = ".url";

/// All keys, with the types of their values. An empty table allows any keys; "*" stands for any
/// key.
constexpr std::string_view kExample =
    "variables = {\"*\" = ''}\n"
    "laboratory = {name = '', environment = {\"*\" = ''}}\n"
    "program = [{name = '', run = [''], environment = {\"*\" = ''}, config = {}, after = [''],"
    " serves = [''], ready_line = '', one_shot = true, ready_deadline = '', restart = '',"
    " stop_patience = '', output = '', main = true, needed = true, optional = true}]\n";

bool is_name(const std::string& name) {
  static const std::regex kForm("[A-Za-z0-9][-A-Za-z0-9_.]{0,31}");
  return std::regex_match(name, kForm);
}

bool contains(const Words& words, std::string_view word) {
  return std::ranges::find(words, word) != words.end();
}

/// Reads one file.
class PlanReader {
 public:
  PlanReader(std::string path, const Variables& variables, const Words& folders)
      : path_(std::move(path)), variables_(variables), folders_(folders) {
    std::error_code error;
    const fs::path file = fs::absolute(path_, error).lexically_normal();
    plan_.file = file.string();
    plan_.folder = file.parent_path().string();
    plan_.name = file.stem().string();
  }

  expected<Plan, std::vector<SetupError>> read(std::string_view text) {
    if (options::may_nest_too_deeply(text)) {
      refuse({1, 1}, "more than " + std::to_string(options::kTomlDotCountMax) +
                         " dots, so that tables may nest too deeply");
    } else if (toml::parse_result parsed = toml::parse(text)) {
      check(parsed.table(), toml::parse(kExample).table());
      read_file(parsed.table());
    } else {
      refuse(parsed.error().source().begin, std::string(parsed.error().description()));
    }
    if (mistakes_.empty()) return std::move(plan_);
    std::vector<SetupError> errors;
    for (auto& [place, error] : mistakes_)
      errors.push_back(std::move(error));
    return unexpected{std::move(errors)};
  }

 private:
  /// Refuses and removes unknown keys, and values whose type differs from the example.
  void check(toml::table& table, const toml::table& example) {
    if (example.empty()) return;
    Words keys;
    for (const auto& [key, model] : example)
      keys.emplace_back(key.str());
    for (const std::string key : {"name", "run"}) {
      if (example.contains("run") && !table.contains(key))
        refuse(table, "'" + key + "' is missing");
    }
    Words wrong;
    for (auto&& [key, node] : table) {
      const std::string name(key.str());
      const toml::node* const model = example.get(keys.front() == "*" ? "*" : name);
      if (model == nullptr) {
        refuse(key.source().begin, "unknown key '" + name + "'" + program::suggestion(name, keys),
               "there are: " + program::joined(keys));
      }
      if (model == nullptr || !is_like(node, *model, name)) wrong.push_back(name);
    }
    for (const std::string& key : wrong)
      table.erase(key);
  }

  /// Whether a value has the example's type. A string may replace a list of strings.
  bool is_like(toml::node& node, const toml::node& example, const std::string& key) {
    if (node.is_table() && example.is_table()) {
      check(*node.as_table(), *example.as_table());
      return true;
    }
    const toml::node& item = example.is_array() ? example.as_array()->front() : example;
    if (node.is_array() && example.is_array()) {
      return std::ranges::all_of(*node.as_array(),
                                 [&](toml::node& inner) { return is_like(inner, item, key); });
    }
    if (node.type() == item.type() && !node.is_table()) return true;
    std::ostringstream types;
    types << node.type() << ", but must be of type " << example.type();
    refuse(node, "'" + key + "' has a value of type " + types.str());
    return false;
  }

  void read_file(const toml::table& file) {
    const auto name = file["laboratory"]["name"];
    plan_.name = name.value_or(plan_.name);
    if (!is_name(plan_.name)) {
      refuse(name ? *name.node() : file, "the laboratory's name '" + plan_.name + kNameForm,
             "[laboratory] name = \"cell\"");
    }
    const toml::table none;
    read_variables(file.contains("variables") ? *file["variables"].as_table() : none);
    if (const toml::array* const programs = file["program"].as_array()) find_programs(*programs);
    if (tables_.empty() && mistakes_.empty())
      refuse({1, 1}, "the file has no program", "add a table [[program]]");
    for (std::size_t i = 0; i < tables_.size(); ++i) {
      read_environment(file["laboratory"]["environment"].as_table(), i);
      read_program(*tables_[i], i);
    }
    Indices path;
    for (std::size_t i = 0; i < tables_.size() && mistakes_.empty(); ++i)
      place(i, path);
    if (mistakes_.empty()) give_registry();
  }

  void read_variables(const toml::table& table) {
    plan_.variables = {{"laboratory.name", plan_.name},
                       {"laboratory.folder", plan_.folder},
                       {"laboratory.file", plan_.file}};
    Words names;
    for (const auto& [key, node] : table)
      plan_.variables[names.emplace_back(key.str())] = node.value_or("");
    for (const auto& [name, value] : variables_) {
      if (!contains(names, name))
        refuse({1, 1}, "no variable '" + name + "' to set" + program::suggestion(name, names));
      plan_.variables[name] = value;
    }
  }

  /// Finds the names of all programs, and leaves out optional ones that are not installed.
  void find_programs(const toml::array& programs) {
    if (programs.size() > kProgramCountMax) return refuse(programs, "more than 64 programs");
    for (const toml::node& node : programs) {
      const toml::table& table = *node.as_table();
      const toml::node* const name_node = table.get("name");
      if (name_node == nullptr) continue;  // check() has reported that.
      const std::string name = name_node->value_or("");
      if (!is_name(name)) refuse(*name_node, "the name '" + name + kNameForm);
      if (index_of(name)) refuse(*name_node, "two programs are called '" + name + "'");
      if (table["optional"].value_or(false) && find_program(table["run"][0].value_or("")).empty()) {
        plan_.left_out.push_back(name);
        continue;
      }
      plan_.variables[name + std::string(kUrl)];
      plan_.programs.push_back({.name = name});
      tables_.push_back(&table);
    }
  }

  void read_program(const toml::table& table, std::size_t index) {
    ProgramPlan& program = plan_.programs[index];
    read_environment(table["environment"].as_table(), index);
    if (const toml::node* const config = table.get("config")) {
      refuse_variables(*config);
      program.environment["RTPM_CONFIG"] = "${laboratory.file}#" + program.name;
    }
    program.command = strings(table, "run", index);
    if (table.contains("run") && program.command.empty())
      refuse(*table.get("run"), "'run' is empty");
    const auto path = expanded(program.command.empty() ? "" : program.command[0], plan_.variables);
    if (path) program.path = find_program(*path);
    if (path && !path->empty() && program.path.empty()) {
      refuse(table["run"][0] ? *table["run"][0].node() : *table.get("run"),
             "there is no program '" + *path + "'",
             "name a file, as ./" + *path + ", or a program in " + program::joined(folders_));
    }
    if (!table.contains("after") && index > 0) program.after.push_back(index - 1);
    for (const std::string& name : strings(table, "after", index)) {
      const auto other = index_of(name);
      if (other) program.after.push_back(*other);
      if (!other && !contains(plan_.left_out, name))
        refuse(*table.get("after"), "'after' has '" + name + "', which is no program of this file");
    }
    program.names = strings(table, "serves", index);
    program.must_print_url |= table["serves"].value_or("") == std::string_view("line");
    if (program.names == Words{"line"}) program.names.clear();
    if (table["serves"].is_string() ? !program.names.empty()
                                    : table["serves"] && program.names.empty())
      refuse(*table.get("serves"),
             "'serves' must be \"line\" or a list of names, as [\"lab/arm0\"]");
    program.ready_line = table["ready_line"].value_or("");
    program.is_one_shot = table["one_shot"].value_or(false);
    read_time(table, "ready_deadline", program.ready_deadline);
    read_time(table, "stop_patience", program.stop_patience);
    program.is_restarted = choice(table, "restart", {"never", "on-failure"}) == 1;
    program.output =
        static_cast<Output>(choice(table, "output", {"lines", "errors", "end", "terminal"}));
    if (program.output == Output::kTerminal && !program.ready_line.empty())
      refuse(*table.get("output"), "with output = \"terminal\" no line is read to make it ready");
    program.is_main = table["main"].value_or(false);
    program.is_needed = table["needed"].value_or(false);
  }

  /// The path of an executable; empty if it is not found. A name with a slash is relative to the
  /// file's folder.
  [[nodiscard]] std::string find_program(const std::string& name) const {
    const bool is_path = name.find('/') != std::string::npos;
    for (const std::string& place : is_path ? Words{plan_.folder} : folders_) {
      std::error_code error;
      const std::string file = (fs::absolute(place, error) / name).lexically_normal();
      if (fs::is_regular_file(file, error) && ::access(file.c_str(), X_OK) == 0) return file;
    }
    return {};
  }

  void read_environment(const toml::table* table, std::size_t index) {
    if (table == nullptr) return;
    for (const auto& [key, node] : *table) {
      plan_.programs[index].environment[std::string(key.str())] = node.value_or("");
      use(index, node, node.value_or(""));
    }
  }

  /// Reads a list of strings, or one string. The program starts after those whose URLs these use.
  Words strings(const toml::table& table, std::string_view key, std::size_t index) {
    Words strings;
    const toml::node* const node = table.get(key);
    const toml::array* const list = node == nullptr ? nullptr : node->as_array();
    for (std::size_t i = 0; i < (list != nullptr ? list->size() : node != nullptr ? 1 : 0); ++i) {
      const toml::node& item = list == nullptr ? *node : (*list)[i];
      use(index, item, strings.emplace_back(item.value_or("")));
    }
    return strings;
  }

  /// Checks a text. The program starts after those whose URLs it uses.
  void use(std::size_t index, const toml::node& node, const std::string& text) {
    Words names;
    const auto value = expanded(text, plan_.variables, &names);
    if (!value) refuse(node, value.error());
    if (text.find('\0') != std::string::npos) refuse(node, "a string has a null character");
    for (const std::string& name : names) {
      const auto used = index_of(name.substr(0, name.rfind(kUrl)));
      if (!used || !name.ends_with(kUrl)) continue;
      Indices& after = plan_.programs[index].after;
      if (std::ranges::count(after, *used) == 0) after.push_back(*used);
      plan_.programs[index].uses.push_back(*used);
      plan_.programs[*used].must_print_url = true;
    }
  }

  void refuse_variables(const toml::node& node) {
    if (node.value_or(std::string_view()).find("${") != std::string_view::npos)
      refuse(node, "variables are not replaced in 'config'", "use 'run' or 'environment'");
    if (const toml::array* const list = node.as_array())
      list->for_each([this](const auto& item) { refuse_variables(item); });
    if (const toml::table* const table = node.as_table())
      table->for_each([this](const auto&, const auto& value) { refuse_variables(value); });
  }

  void read_time(const toml::table& table, const std::string& key, Duration& value) {
    const auto text = table[key].value<std::string>();
    if (!text) return;
    value = program::parse_duration(*text).value_or(Duration{0});
    if (value < std::chrono::milliseconds{1} || value > std::chrono::hours{24})
      refuse(*table.get(key), "'" + key + "' must be a time from \"1ms\" to \"24h\"");
  }

  /// The index of the chosen word; 0 if the key is missing, or if the word is unknown, which is
  /// reported.
  std::size_t choice(const toml::table& table, const std::string& key, const Words& words) {
    const std::string word = table[key].value_or(words.front());
    const auto found = std::ranges::find(words, word);
    if (found != words.end()) return static_cast<std::size_t>(found - words.begin());
    refuse(*table.get(key), "'" + key + "' is \"" + word + "\"" + program::suggestion(word, words) +
                                ", but must be one of " + program::joined(words));
    return 0;
  }

  /// Orders the program after those that it depends on.
  /// @param path  the programs that wait for this one
  void place(std::size_t index, Indices& path) {
    if (std::ranges::count(plan_.order, index) > 0) return;
    if (const auto seen = std::ranges::find(path, index); seen != path.end()) {
      Words names;
      for (auto program = seen; program != path.end(); ++program)
        names.push_back("'" + plan_.programs[*program].name + "'");
      const toml::node* const after = tables_[index]->get("after");
      return refuse(after == nullptr ? *tables_[index] : *after,
                    program::joined(names) +
                        (names.size() > 1 ? " wait for each other" : " waits for itself"));
    }
    path.push_back(index);
    for (const std::size_t other : plan_.programs[index].after)
      if (mistakes_.empty()) place(other, path);
    path.pop_back();
    plan_.order.push_back(index);
  }

  /// Passes the URL of the file's registry to all programs that start later and name no other
  /// registry.
  void give_registry() {
    const auto is_registry = [this](std::size_t index) {
      return fs::path(plan_.programs[index].path).filename() == "rtpm-registryd";
    };
    const auto registry = std::ranges::find_if(plan_.order, is_registry);
    for (auto at = registry; at != plan_.order.end(); ++at) {
      const std::string url = "${" + plan_.programs[*registry].name + ".url}";
      if (at != registry && plan_.programs[*at].environment.emplace("RTPM_REGISTRY", url).second)
        use(*at, *tables_[*at], url);
    }
  }

  [[nodiscard]] std::optional<std::size_t> index_of(std::string_view name) const {
    const auto found = std::ranges::find(plan_.programs, name, &ProgramPlan::name);
    if (found == plan_.programs.end()) return std::nullopt;
    return static_cast<std::size_t>(found - plan_.programs.begin());
  }

  void refuse(const toml::node& node, const std::string& what, std::string remedy = {}) {
    refuse(node.source().begin, what, std::move(remedy));
  }
  void refuse(toml::source_position at, const std::string& what, std::string remedy = {}) {
    const std::string place = std::to_string(at.line) + ":" + std::to_string(at.column);
    mistakes_.emplace(std::tuple(at.line, at.column, what),
                      SetupError{path_ + ":" + place + ": " + what, {}, std::move(remedy)});
  }

  const std::string path_;
  const Variables& variables_;
  const Words& folders_;
  Plan plan_{};
  std::vector<const toml::table*> tables_{};  ///< The table of each program.
  /// Sorted like the file, without duplicates.
  std::map<std::tuple<toml::source_index, toml::source_index, std::string>, SetupError> mistakes_{};
};

}  // namespace

Words program_folders() {
  std::error_code error;
  Words folders{fs::read_symlink("/proc/self/exe", error).parent_path()};
  const char* const path = std::getenv("PATH");
  std::istringstream list(path == nullptr ? "/usr/local/bin:/usr/bin:/bin" : path);
  for (std::string folder; std::getline(list, folder, ':');)
    folders.push_back(folder.empty() ? "." : folder);
  return folders;
}

expected<std::string, std::string> expanded(std::string_view text, const Variables& variables,
                                            Words* used) {
  constexpr std::string_view kEnvironment = "environment.";
  std::string value;
  for (std::size_t at = 0; at < text.size(); ++at) {
    if (!text.substr(at).starts_with("${")) {
      value += text[at];
      if (text.substr(at).starts_with("$$")) ++at;
      continue;
    }
    const std::size_t end = text.find('}', at);
    if (end == std::string_view::npos) return unexpected{std::string("'${' has no '}'")};
    const std::string name(text.substr(at + 2, end - at - 2));
    const auto found = variables.find(name);
    const char* const own =
        name.starts_with(kEnvironment) ? std::getenv(&name[kEnvironment.size()]) : nullptr;
    if (found == variables.end() && own == nullptr) {
      Words names;
      for (const auto& [variable, ignored] : variables)
        names.push_back(variable);
      return unexpected{"${" + name + "} is not set" + program::suggestion(name, names)};
    }
    value += found != variables.end() ? found->second : own;
    if (used != nullptr) used->push_back(name);
    at = end;
  }
  return value;
}

expected<Plan, std::vector<SetupError>> read_plan(const std::string& path,
                                                  const Variables& variables,
                                                  const Words& folders) {
  std::error_code error;
  const auto size = fs::file_size(path, error);
  if (!error && size > options::kTomlSizeMax)
    error = std::make_error_code(std::errc::file_too_large);
  std::ifstream file(path);
  const std::string text{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  if (!error && !file) error = std::make_error_code(std::errc::io_error);
  if (!error) return PlanReader(path, variables, folders).read(text);
  return unexpected{std::vector<SetupError>{{"the laboratory's file '" + path + "' can't be read",
                                             error.message(), "name a readable file", error}}};
}

}  // namespace rtpm::laboratory
