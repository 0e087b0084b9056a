#include "cli/program.hpp"

#include <algorithm>
#include <cstdlib>
#include <string>
#include <vector>

#include "cli/command.hpp"
#include "cli/completion.hpp"
#include "cli/manual.hpp"
#include "cli/version.hpp"
#include "devices/commands.hpp"
#include "events/commands.hpp"
#include "host/commands.hpp"
#include "keys/commands.hpp"
#include "laboratory/commands.hpp"
#include "objects/commands.hpp"
#include "recordings/commands.hpp"
#include "rtpm/program/text.hpp"
#include "rtpm/rt/log.hpp"
#include "rtpm/wire/url.hpp"

namespace rtpm::tool {
namespace {

constexpr const char* kFooter =
    "TARGET and DEVICE are names, or URLs rtpm://host:port/path.\n"
    "`rtpm COMMAND --help` explains a command. The options above may stand behind it, too.\n\n"
    "Exit codes: 0 done; 1 failed, or the answer is no; 2 wrong command line; 3 no registry, no\n"
    "server or no such name.\n";

void add_common_options(CLI::App& program, Context& context) {
  const auto is_url = [](const std::string& text) {
    return wire::is_url(text) ? std::string{} : "'" + text + "' is no URL rtpm://host:port/path";
  };
  const auto take_place = [&context](const std::string& how) { context.registry = how; };
  CLI::Option* const registry =
      program
          .add_option_function<std::string>("--registry", take_place,
                                            "The registry; without, names are found")
          ->envname("RTPM_REGISTRY")
          ->check(is_url)
          ->type_name("URL");
  program
      .add_option_function<std::string>(
          "--discover",
          [&context, registry](const std::string& how) {
            if (registry->empty()) context.registry = how;
          },
          "Where: host, lan[:DOMAIN]@INTERFACE, or HOST[:PORT],…")
      ->envname("RTPM_DISCOVER")
      ->default_str(std::string(names::kThisHost))
      ->type_name("HOW");
  program.add_flag("--json", context.json, "Print JSON, a document per line");
  add_duration(program, "--deadline", context.deadline,
               "How long a call may take; without: as the schema says, else 1s",
               {std::chrono::microseconds{1}, std::chrono::hours{1}})
      .envname("RTPM_DEADLINE");
  const auto take = [&context](const std::int32_t& priority) { context.priority = priority; };
  program.add_option("--key", context.security.key_file, "Your key; without: ~/.config/rtpm/key")
      ->envname("RTPM_KEY")
      ->type_name("FILE");
  program
      .add_option("--known-servers", context.security.known_servers_file,
                  "Servers and their keys; without: ~/.config/rtpm/known_servers")
      ->envname("RTPM_KNOWN_SERVERS")
      ->type_name("FILE");
  program.add_option_function<std::int32_t>("--priority", take, "The priority of calls")
      ->check(CLI::Range(0, 32767))
      ->type_name("0..32767");
}

/// The innermost command selected by the arguments.
const CLI::App& innermost(const CLI::App& program) {
  const CLI::App* app = &program;
  while (!app->get_subcommands().empty())
    app = app->get_subcommands().front();
  return *app;
}

std::string name_of(const CLI::App& app) {
  const CLI::App* const parent = app.get_parent();
  return (parent == nullptr ? "" : name_of(*parent) + " ") + app.get_name();
}

/// Returns " (did you mean 'list'?)" for a word that is not a command or option of `app`.
std::string similar(const CLI::App& app, const std::string& word) {
  std::vector<std::string> names;
  if (!word.starts_with("-")) {
    for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; }))
      names.push_back(command->get_name());
    return program::suggestion(word, names);
  }
  for (const CLI::App* above = &app; above != nullptr; above = above->get_parent()) {
    for (const CLI::Option* option : above->get_options()) {
      for (const std::string& name : option->get_lnames())
        names.push_back("--" + name);
    }
  }
  return program::suggestion(word.substr(0, word.find('=')), names);
}

/// Describes the mistake in the arguments, as a clause.
std::string clause_of(const CLI::App& program, const CLI::ParseError& error) {
  const CLI::App& app = innermost(program);
  const std::vector<std::string> extras = program.remaining(true);
  const bool is_about_extras = error.get_name() == "ExtrasError" || app.get_subcommands().empty();
  if (is_about_extras && !extras.empty() && error.get_name() != "ValidationError") {
    const std::string& word = extras.front();
    const bool has_commands = !app.get_subcommands([](const CLI::App*) { return true; }).empty();
    const char* const kind = word.starts_with("-") ? "unknown option '"
                             : has_commands        ? "unknown command '"
                                                   : "unexpected argument '";
    return kind + word + "'" + similar(app, word);
  }
  const bool lacks_command = !app.get_subcommands([](const CLI::App*) { return true; }).empty();
  return lacks_command ? "a command is missing" : error.what();
}

int tell_misuse(const CLI::App& program, const Context& context, const CLI::ParseError& error) {
  const std::string remedy = "run '" + name_of(innermost(program)) + " --help'";
  if (context.json) return context.fail({clause_of(program, error), {}, remedy}, kMisused);
  rt::print_error("rtpm", clause_of(program, error) + "; " + remedy);
  return kMisused;
}

}  // namespace

std::unique_ptr<CLI::App> make_program(Context& context) {
  auto program =
      std::make_unique<CLI::App>("sees, calls, records and replays RTPM's objects", "rtpm");
  program->set_version_flag("--version", "rtpm " RTPM_VERSION, "Print the version");
  program->footer(kFooter);
  program->require_subcommand(1);
  program->fallthrough();  // The common options may follow the command.
  program->get_formatter()->column_width(34);
  program->get_formatter()->label("Positionals", "Arguments");
  program->get_formatter()->label("SUBCOMMAND", "COMMAND");
  program->get_formatter()->label("REQUIRED", "");
  add_common_options(*program, context);
  add_list(*program, context);
  add_info(*program, context);
  add_stubs(*program, context);
  add_find(*program, context);
  add_watch(*program, context);
  add_bind(*program, context);
  add_unbind(*program, context);
  add_resolve(*program, context);
  add_call(*program, context);
  add_ping(*program, context);
  add_echo(*program, context);
  add_pub(*program, context);
  add_mark(*program, context);
  add_hz(*program, context);
  add_consumers(*program, context);
  add_incidents(*program, context);
  add_record(*program, context);
  add_session(*program, context);
  add_play(*program, context);
  add_bag(*program, context);
  add_config(*program, context);
  add_take_over(*program, context);
  add_estop(*program, context);
  add_flight_record(*program, context);
  add_lanes(*program, context);
  add_clocks(*program, context);
  add_top(*program, context);
  add_doctor(*program, context);
  add_key(*program, context);
  add_up(*program, context);
  add_down(*program, context);
  add_demo(*program, context);
  add_ros2(*program, context);
  add_version(*program, context);
  add_completion(*program, context);
  add_manual(*program, context);
  return program;
}

int run_program(CLI::App& program, Context& context, int argc, const char* const* argv) {
  try {
    program.parse(argc, argv);
  } catch (const CLI::Success& information) {  // --help, --version
    return program.exit(information);
  } catch (const CLI::ParseError& error) {
    return tell_misuse(program, context, error);
  }
  return context.chosen(context);
}

}  // namespace rtpm::tool
