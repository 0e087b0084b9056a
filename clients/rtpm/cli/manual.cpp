#include "cli/manual.hpp"

#include <cstdio>

#include "cli/command.hpp"
#include "cli/output.hpp"

namespace rtpm::tool {
namespace {

/// Escapes text for roff: a dot or quote at the start of a line would be a request.
std::string roff(const std::string& text) {
  std::string safe;
  for (const char byte : text) {
    const bool is_begin = safe.empty() || safe.back() == '\n';
    if (is_begin && (byte == '.' || byte == '\'')) safe += "\\&";
    if (byte == '\\') {
      safe += "\\e";
    } else if (byte == '-') {
      safe += "\\-";
    } else {
      safe += byte;
    }
  }
  return safe;
}

/// "config set DEVICE SETTINGS… [OPTIONS]".
std::string form_of(const CommandFacts& command) {
  std::string form = command.path;
  for (const OptionFacts& option : command.options) {
    if (!option.is_positional) continue;
    const std::string name = option.name + (option.is_list ? "..." : "");
    form += option.is_required ? " " + name : " [" + name + "]";
  }
  return form;
}

std::string options_text(const CommandFacts& command) {
  std::string text;
  for (const OptionFacts& option : command.options) {
    if (option.name == "--help" || option.help.empty()) continue;
    text += ".TP\n.B " + roff(option.name) +
            (option.value.empty() ? "" : " " + roff(option.value)) + "\n" + roff(option.help) +
            "\n";
  }
  return text;
}

std::string command_text(const CommandFacts& command) {
  std::string text = ".SS " + roff(form_of(command)) + "\n" + roff(command.summary) + ".\n";
  text += options_text(command);
  if (!command.details.empty()) text += ".PP\n.nf\n" + roff(command.details) + ".fi\n";
  return text;
}

}  // namespace

std::string manual_page(const CommandFacts& program) {
  std::string page =
      ".TH RTPM 1 \"\" \"rtpm " RTPM_VERSION "\"\n.SH NAME\nrtpm \\- " + roff(program.summary) +
      "\n.SH SYNOPSIS\n.B rtpm\nCOMMAND [ARGUMENTS] [OPTIONS]\n"
      ".SH DESCRIPTION\n.nf\n" +
      roff(program.details) + ".fi\n.SH OPTIONS\n" + options_text(program) + ".SH COMMANDS\n";
  for (const CommandFacts* command : flattened(program)) {
    if (command != &program && command->commands.empty()) page += command_text(*command);
  }
  page +=
      ".SH ENVIRONMENT\n"
      ".TP\n.B RTPM_REGISTRY\nAs \\-\\-registry.\n"
      ".TP\n.B RTPM_DISCOVER\nAs \\-\\-discover.\n"
      ".TP\n.B RTPM_RUNTIME_FOLDER\nThe folder in which programs of this host find each other.\n"
      ".TP\n.B RTPM_DEADLINE\nAs \\-\\-deadline.\n"
      ".TP\n.B NO_COLOR\nIf it is set, no output has colours.\n";
  return page;
}

void add_manual(CLI::App& program, Context& context) {
  add_command(program, context, "manual", "Print the manual page", "  rtpm manual | man -l -\n",
              [&program](Context& c) {
                const std::string page = manual_page(facts_of(program));
                if (c.json) {
                  print_json({{"page", page}});
                } else {
                  std::fputs(page.c_str(), stdout);
                }
                return kDone;
              });
}

}  // namespace rtpm::tool
