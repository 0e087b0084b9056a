#include "laboratory/file.hpp"

#include <csignal>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>
#include <utility>

#include "laboratory/table_reader.hpp"
#include "laboratory/variables.hpp"
#include "rtpm/options/suggestion.hpp"

namespace rtpm::laboratory {
namespace {

namespace fs = std::filesystem;

using Environment = std::vector<std::pair<std::string, Text>>;

constexpr std::size_t kArgumentCountMax = 1024;
constexpr const char* kNameForm =
    "letters, digits, '-', '_' and '.', a letter or digit first, at most 32";
constexpr options::Range<Duration> kTimes{Duration{0}, std::chrono::hours{24}};

/// Reads one file.
class PlanReader {
 public:
  PlanReader(const std::string& path, const FileContext& context) : context_(context) {
    std::error_code error;
    const fs::path file = fs::absolute(path, error).lexically_normal();
    plan_.file = file.string();
    folder_ = file.parent_path().string();
    plan_.name = file.stem().string();
  }

  expected<Plan, std::vector<Mistake>> read(const Value& document) {
    TableReader top(document, "", mistakes_);
    const Value* const laboratory = top.take("laboratory", Value::Kind::kTable, "a table");
    const Value* const variables = top.take("variables", Value::Kind::kTable, "a table");
    const Value* const programs = top.take("program", Value::Kind::kList, "tables [[program]]");
    top.refuse_unknown();
    if (laboratory != nullptr) read_name(*laboratory);
    read_variables(top, variables);
    const Value present = programs == nullptr ? Value{} : without_missing(*programs);
    if (present.items.empty()) {
      if (mistakes_.empty()) top.refuse({}, "the file has no program", "add a table [[program]]");
    } else {
      read_names(top, present);
    }
    if (laboratory != nullptr) read_laboratory(*laboratory);
    for (std::size_t i = 0; i < plan_.programs.size(); ++i)
      read_program(i, present.items[i]);
    if (mistakes_.empty()) order(top);
    if (mistakes_.empty()) return std::move(plan_);
    std::ranges::stable_sort(mistakes_, {}, [](const Mistake& mistake) {
      return std::pair(mistake.position.line, mistake.position.column);
    });
    return unexpected{std::move(mistakes_)};
  }

 private:
  void read_name(const Value& table) {
    TableReader reader(table, "", mistakes_);
    const Value* const name = reader.read("name", plan_.name);
    if (name != nullptr && !is_name(plan_.name)) {
      reader.refuse(name->position, "the name '" + plan_.name + "' must be " + kNameForm);
    }
  }

  void read_variables(TableReader& top, const Value* table) {
    if (table != nullptr) {
      for (const Value& value : table->items) {
        if (value.kind == Value::Kind::kText) {
          scope_.variables[value.key] = value.text;
        } else if (value.kind == Value::Kind::kInteger) {
          scope_.variables[value.key] = std::to_string(value.integer);
        } else {
          top.refuse(value.position, "the variable '" + value.key + "' is " + value.kind_text() +
                                         ", but must be a text or a whole number");
        }
      }
    }
    std::vector<std::string> names;
    for (const auto& [name, value] : scope_.variables)
      names.push_back(name);
    for (const auto& [name, value] : context_.variables) {
      if (!scope_.variables.contains(name)) {
        top.refuse(table == nullptr ? Position{} : table->position,
                   "there is no variable '" + name + "' to set" + options::suggestion(name, names));
      }
      scope_.variables[name] = value;
    }
    scope_.variables["laboratory.name"] = plan_.name;
    scope_.variables["laboratory.folder"] = folder_;
  }

  /// The programs without optional ones that are not installed.
  Value without_missing(Value programs) {
    std::erase_if(programs.items, [this](const Value& item) {
      const Value* const optional = item.find("optional");
      const Value* const run = item.find("run");
      const Value* const name = item.find("name");
      if (optional == nullptr || !optional->boolean || name == nullptr) return false;
      if (run == nullptr || run->items.empty()) return false;
      if (context_.folders.find(run->items.front().text, folder_)) return false;
      plan_.left_out.push_back(name->text);
      return true;
    });
    return programs;
  }

  void read_names(TableReader& top, const Value& programs) {
    if (programs.items.size() > kProgramCountMax) {
      top.refuse(programs.items[kProgramCountMax].position,
                 "more than " + std::to_string(kProgramCountMax) + " programs");
      return;
    }
    for (const Value& item : programs.items) {
      ProgramPlan program{.name = {}, .folder = folder_};
      if (item.kind != Value::Kind::kTable) {
        top.refuse(item.position, "a program is " + item.kind_text() + ", but must be a table");
      } else {
        TableReader reader(item, "", mistakes_);
        const Value* const name = reader.read("name", program.name);
        if (name == nullptr && item.find("name") == nullptr) {
          reader.refuse(item.position, "the program has no 'name'");
        } else if (name != nullptr && !is_name(program.name)) {
          reader.refuse(name->position, "the name '" + program.name + "' must be " + kNameForm);
        } else if (name != nullptr &&
                   std::ranges::find(scope_.programs, program.name) != scope_.programs.end()) {
          reader.refuse(name->position, "two programs are called '" + program.name + "'");
        }
      }
      positions_.push_back(item.position);
      scope_.programs.push_back(program.name);
      plan_.programs.push_back(std::move(program));
    }
  }

  void read_laboratory(const Value& table) {
    TableReader reader(table, "", mistakes_);
    static_cast<void>(reader.take("name"));
    read_literal(reader, "logs", plan_.log_folder);
    if (!plan_.log_folder.empty()) plan_.log_folder = below_folder(plan_.log_folder);
    std::string registry;
    if (const Value* const value = read_literal(reader, "registry", registry)) {
      const auto program = std::ranges::find(scope_.programs, registry);
      if (program != scope_.programs.end()) {
        plan_.registry_program = static_cast<std::size_t>(program - scope_.programs.begin());
      } else if (registry.starts_with("rtpm://")) {
        plan_.registry_url = registry;
      } else {
        reader.refuse(value->position,
                      "the registry '" + registry + "'" +
                          options::suggestion(registry, scope_.programs) +
                          " is neither a program of this file nor a URL rtpm://host:port/path");
      }
    }
    read_environment(reader, environment_);
    reader.refuse_unknown();
  }

  void read_program(std::size_t index, const Value& table) {
    if (table.kind != Value::Kind::kTable) return;
    ProgramPlan& program = plan_.programs[index];
    TableReader reader(table, program.name.empty() ? "a program" : "program '" + program.name + "'",
                       mistakes_);
    static_cast<void>(reader.take("name"));
    std::string folder;
    if (const Value* const value = read_literal(reader, "folder", folder)) {
      program.folder = below_folder(folder);
      std::error_code error;
      if (!fs::is_directory(program.folder, error)) {
        reader.refuse(value->position, "there is no folder " + program.folder);
      }
    }
    read_command(reader, table, program);
    program.environment = environment_;
    read_environment(reader, program.environment);
    read_after(reader, index);
    read_readiness(reader, program);
    read_restart(reader, program);
    reader.read("stop_patience", program.stop_patience, {Duration{0}, std::chrono::minutes{10}});
    reader.read("stop_signal", program.stop_signal,
                {{"TERM", SIGTERM}, {"INT", SIGINT}, {"HUP", SIGHUP}, {"QUIT", SIGQUIT}});
    reader.read("output", program.output,
                {{"lines", Output::kLines},
                 {"errors", Output::kErrors},
                 {"end", Output::kEnd},
                 {"terminal", Output::kTerminal},
                 {"none", Output::kNone}});
    reader.read("main", program.is_main);
    reader.read("needed", program.is_needed);
    bool is_optional = false;  // See without_missing().
    reader.read("optional", is_optional);
    reader.refuse_unknown();
    check(reader, table, program);
  }

  /// Checks the combinations of keys.
  void check(TableReader& reader, const Value& table, const ProgramPlan& program) {
    if (program.restart == Restart::kAlways && program.readiness == Readiness::kExit) {
      reader.refuse(table.find("restart")->position,
                    "a program that is ready when it has ended can't be restarted always",
                    "restart = \"on-failure\"");
    }
    const bool is_seen = program.output != Output::kTerminal;
    if (!is_seen &&
        (program.readiness == Readiness::kUrl || program.readiness == Readiness::kLine)) {
      reader.refuse(table.find("output")->position,
                    "what a program prints to the terminal is not read, so no line makes it ready");
    }
    if (program.restart_delay > program.restart_delay_max) {
      reader.refuse(table.find("restart_delay") != nullptr
                        ? table.find("restart_delay")->position
                        : table.find("restart_delay_max")->position,
                    "'restart_delay' is longer than 'restart_delay_max'");
    }
  }

  void read_command(TableReader& reader, const Value& table, ProgramPlan& program) {
    const Value* const run = reader.take("run", Value::Kind::kList, "a list of texts");
    if (run == nullptr) {
      if (table.find("run") == nullptr) {
        reader.refuse(table.position, "'run' is missing", "run = [\"PROGRAM\", \"ARGUMENT\"]");
      }
      return;
    }
    if (run->items.empty() || run->items.size() > kArgumentCountMax) {
      reader.refuse(run->position, "'run' must have 1 to 1024 texts, the program first");
      return;
    }
    for (const Value& item : run->items) {
      if (item.kind != Value::Kind::kText) {
        reader.refuse(item.position, "'run' has " + item.kind_text() +
                                         ", but must be a list of texts, each in quotes");
        return;
      }
      if (auto text = expanded(reader, item)) program.command.push_back(std::move(*text));
    }
    if (program.command.size() != run->items.size()) return;
    const Value& first = run->items.front();
    const auto name = literal(reader, first);
    if (!name) return;
    auto found = context_.folders.find(*name, program.folder);
    if (!found) {
      reader.refuse(first.position, "there is no program '" + *name + "': " + found.error());
      return;
    }
    program.path = std::move(*found);
    if (fs::path(program.path).filename() == "rtpm-registryd" && !plan_.registry_program &&
        plan_.registry_url.empty()) {
      plan_.registry_program = static_cast<std::size_t>(&program - plan_.programs.data());
    }
  }

  void read_environment(TableReader& reader, Environment& environment) {
    const Value* const table = reader.take("environment", Value::Kind::kTable, "a table of texts");
    if (table == nullptr) return;
    for (const Value& entry : table->items) {
      if (entry.kind != Value::Kind::kText) {
        reader.refuse(entry.position, "the environment's '" + entry.key + "' is " +
                                          entry.kind_text() + ", but must be a text");
      } else if (entry.key.empty() || entry.key.find('=') != std::string::npos) {
        reader.refuse(entry.key_position, "'" + entry.key + "' is no name of a variable");
      } else if (auto text = expanded(reader, entry)) {
        std::erase_if(environment, [&](const auto& former) { return former.first == entry.key; });
        environment.emplace_back(entry.key, std::move(*text));
      }
    }
  }

  void read_after(TableReader& reader, std::size_t index) {
    ProgramPlan& program = plan_.programs[index];
    const Value* const value = reader.take("after");
    if (value == nullptr) {
      if (index > 0) program.after = {index - 1};
      return;
    }
    const bool is_text = value->kind == Value::Kind::kText;
    if (!is_text && value->kind != Value::Kind::kList) {
      reader.refuse(value->position, "'after' is " + value->kind_text() +
                                         ", but must be a program's name or a list of names");
      return;
    }
    for (const Value& item : is_text ? std::vector<Value>{*value} : value->items) {
      if (std::ranges::find(plan_.left_out, item.text) != plan_.left_out.end()) continue;
      const auto found = std::ranges::find(scope_.programs, item.text);
      if (item.kind != Value::Kind::kText || found == scope_.programs.end()) {
        reader.refuse(item.position, "'after' has " + item.kind_text() +
                                         options::suggestion(item.text, scope_.programs) +
                                         ", which is no program of this file");
        continue;
      }
      program.after.push_back(static_cast<std::size_t>(found - scope_.programs.begin()));
    }
    positions_[index] = value->position;
  }

  void read_readiness(TableReader& reader, ProgramPlan& program) {
    reader.read("ready_deadline", program.ready_deadline,
                {std::chrono::milliseconds{1}, std::chrono::hours{24}});
    const Value* const serves = reader.take("serves");
    const Value* const line = read_literal(reader, "ready_line", program.ready_line);
    bool is_one_shot = false;
    const Value* const one_shot = reader.read("one_shot", is_one_shot);
    if (serves != nullptr) read_serves(reader, *serves, program);
    if (line != nullptr) {
      program.readiness = Readiness::kLine;
      if (program.ready_line.empty()) reader.refuse(line->position, "'ready_line' is empty");
    }
    if (is_one_shot) program.readiness = Readiness::kExit;
    const int count = int{serves != nullptr} + int{line != nullptr} + int{is_one_shot};
    if (count > 1) {
      reader.refuse((is_one_shot ? one_shot : line)->position,
                    "'serves', 'ready_line' and 'one_shot' exclude each other");
    }
  }

  void read_serves(TableReader& reader, const Value& value, ProgramPlan& program) {
    if (value.kind == Value::Kind::kText && value.text == "line") {
      program.readiness = Readiness::kUrl;
      return;
    }
    if (value.kind != Value::Kind::kList || value.items.empty()) {
      reader.refuse(value.position, "'serves' is " + value.kind_text() +
                                        ", but must be \"line\" or a list of names, such as "
                                        "[\"lab/arm0\"]");
      return;
    }
    program.readiness = Readiness::kNames;
    for (const Value& item : value.items) {
      if (item.kind != Value::Kind::kText || item.text.empty()) {
        reader.refuse(item.position,
                      "'serves' has " + item.kind_text() + ", but must be a list of names");
      } else if (auto name = literal(reader, item)) {
        program.names.push_back(std::move(*name));
      }
    }
  }

  static void read_restart(TableReader& reader, ProgramPlan& program) {
    reader.read("restart", program.restart,
                {{"never", Restart::kNever},
                 {"on-failure", Restart::kOnFailure},
                 {"always", Restart::kAlways}});
    reader.read("restart_limit", program.restart_limit, {0, 1000});
    reader.read("restart_window", program.restart_window,
                {std::chrono::milliseconds{1}, std::chrono::hours{24}});
    reader.read("restart_delay", program.restart_delay, kTimes);
    reader.read("restart_delay_max", program.restart_delay_max, kTimes);
  }

  void order(TableReader& top) {
    connect(plan_);
    std::vector<std::size_t> cycle;
    plan_.order = start_order(plan_.programs, cycle);
    if (!cycle.empty()) refuse_cycle(top, cycle);
  }

  void refuse_cycle(TableReader& top, const std::vector<std::size_t>& cycle) {
    std::string names;
    for (const std::size_t program : cycle)
      names += (names.empty() ? "'" : ", '") + plan_.programs[program].name + "'";
    top.refuse(positions_[cycle.front()], cycle.size() == 1
                                              ? "the program " + names + " waits for itself"
                                              : "the programs " + names + " wait for each other");
  }

  std::optional<Text> expanded(TableReader& reader, const Value& value) {
    if (value.text.find('\0') != std::string::npos) {
      reader.refuse(value.position, "a text has a null character");
      return std::nullopt;
    }
    auto text = expand(value.text, scope_);
    if (text) return std::move(*text);
    reader.refuse(value.position, text.error());
    return std::nullopt;
  }

  /// Expands a text that must be known before any program runs.
  std::optional<std::string> literal(TableReader& reader, const Value& value) {
    const auto text = expanded(reader, value);
    if (!text) return std::nullopt;
    if (text->programs().empty()) return text->resolved({});
    reader.refuse(value.position, "a program's URL can stand in 'run' and 'environment' only");
    return std::nullopt;
  }

  const Value* read_literal(TableReader& reader, std::string_view key, std::string& text) {
    std::string raw;
    const Value* const value = reader.read(key, raw);
    if (value == nullptr) return nullptr;
    auto known = literal(reader, *value);
    if (!known) return nullptr;
    text = std::move(*known);
    return value;
  }

  [[nodiscard]] std::string below_folder(const std::string& path) const {
    return (fs::path(folder_) / path).lexically_normal().string();
  }

  const FileContext& context_;
  std::string folder_{};
  Plan plan_{};
  Scope scope_{};
  Environment environment_{};
  std::vector<Position> positions_{};  ///< The position of each program, or of its 'after'.
  std::vector<Mistake> mistakes_{};
};

}  // namespace

bool is_name(std::string_view name) {
  const auto is_alphanumeric = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
  };
  return !name.empty() && name.size() <= 32 && is_alphanumeric(name.front()) &&
         std::ranges::all_of(
             name, [&](char c) { return is_alphanumeric(c) || c == '-' || c == '_' || c == '.'; });
}

expected<Plan, std::vector<Mistake>> parse_plan(std::string_view text, const std::string& path,
                                                const FileContext& context) {
  const auto document = parse_document(text);
  if (!document) return unexpected{std::vector{document.error()}};
  auto plan = PlanReader(path, context).read(*document);
  if (plan && !is_name(plan->name)) {
    return unexpected{std::vector{Mistake{
        {},
        "the file's name '" + plan->name + "' can't be the laboratory's: it must be " + kNameForm,
        "[laboratory] name = \"cell\""}}};
  }
  return plan;
}

expected<Plan, std::vector<SetupError>> read_plan(const std::string& path,
                                                  const FileContext& context) {
  std::error_code error;
  const auto fail = [&](std::error_code why) {
    return unexpected{std::vector{SetupError{"the laboratory's file '" + path + "' can't be read",
                                             why.message(), "name a readable file", why}}};
  };
  const auto size = fs::file_size(path, error);
  if (error) return fail(error);
  if (size > kFileSizeMax) return fail(std::make_error_code(std::errc::file_too_large));
  std::ifstream file(path);
  const std::string text{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  if (!file) return fail(std::make_error_code(std::errc::io_error));
  auto plan = parse_plan(text, path, context);
  if (plan) return std::move(*plan);
  std::vector<SetupError> errors;
  for (const Mistake& mistake : plan.error()) {
    errors.push_back({path + ":" + std::to_string(mistake.position.line) + ":" +
                          std::to_string(mistake.position.column) + ": " + mistake.what,
                      {},
                      mistake.remedy});
  }
  return unexpected{std::move(errors)};
}

}  // namespace rtpm::laboratory
