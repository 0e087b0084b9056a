#include "cli/completion.hpp"

#include <algorithm>
#include <cstdio>
#include <vector>

#include "cli/command.hpp"
#include "cli/output.hpp"
#include "objects/live_words.hpp"
#include "os/system.hpp"

namespace rtpm::tool {
namespace {

/// A shell command that prints names, or the target's methods or parameters; it ends quickly even
/// without a registry.
constexpr const char* kLive =
    "rtpm completion --words \"$command\" --of \"$target\" --deadline 300ms 2>/dev/null";

struct Candidate {
  std::string word;
  std::string help;
};

/// Cases of bash and zsh in the loop over the words so far: the first word behind a command that is
/// no option is its target.
constexpr const char* kTargetSteps =
    "      *\" -\"*) ;;\n"
    "      *) [[ -n $command && -z $target ]] && target=$word ;;\n";

struct CompletionRequest {
  std::string shell{};
  std::string command{};
  std::string target{};
};

int print_words(Context& context, const CompletionRequest& request) {
  // A shell never waits for longer.
  os::end_after(context.deadline.value_or(std::chrono::milliseconds{300}), kNotReached);
  const auto words = live_words(context, request.command, request.target);
  if (!words) return context.not_reached(words.error());
  if (context.json) {
    print_json(*words);
    return kDone;
  }
  std::string text;
  for (const std::string& word : *words)
    text += word + "\n";
  std::fputs(text.c_str(), stdout);
  return kDone;
}

/// The words that may follow a command: its subcommands, choices and options, and the common
/// options.
std::vector<Candidate> candidates_of(const CommandFacts& program, const CommandFacts& command) {
  std::vector<Candidate> list;
  for (const CommandFacts& below : command.commands)
    list.push_back({below.name, below.summary});
  const auto add_options = [&list](const CommandFacts& owner) {
    for (const OptionFacts& option : owner.options) {
      if (!option.is_positional) list.push_back({option.name, option.help});
      for (const std::string& choice : option.choices)
        list.push_back({choice, option.help});
    }
  };
  add_options(command);
  if (&command != &program) add_options(program);
  return list;
}

/// Patterns of "COMMANDS-SO-FAR WORD" in which the word is a command:
/// `" list"|"config set"`.
std::string steps_of(const CommandFacts& program) {
  std::string patterns;
  for (const CommandFacts* command : flattened(program)) {
    if (command == &program) continue;
    const std::size_t space = command->path.rfind(' ');
    const std::string step = space == std::string::npos ? " " + command->path : command->path;
    patterns += (patterns.empty() ? "" : "|") + ("\"" + step + "\"");
  }
  return patterns;
}

/// Puts the text in single quotes, for a shell.
std::string quoted(const std::string& text) {
  std::string safe = "'";
  for (const char byte : text)
    safe += byte == '\'' ? std::string("'\\''") : std::string(1, byte);
  return safe + "'";
}

/// Escapes the colons of a word, because in zsh a colon ends the candidate.
std::string without_colons(std::string text) {
  for (std::size_t at = text.find(':'); at != std::string::npos; at = text.find(':', at + 2))
    text.insert(at, "\\");
  return text;
}

}  // namespace

std::string bash_completion(const CommandFacts& program) {
  std::string script =
      "# Completion of rtpm for bash; made by `rtpm completion bash`.\n"
      "_rtpm() {\n"
      "  local current=${COMP_WORDS[COMP_CWORD]} command= target= words= files= word\n"
      "  for word in \"${COMP_WORDS[@]:1:COMP_CWORD-1}\"; do\n"
      "    case \"$command $word\" in\n"
      "      " +
      steps_of(program) + ") command=\"${command:+$command }$word\" ;;\n" + kTargetSteps +
      "    esac\n"
      "  done\n"
      "  case $command in\n";
  for (const CommandFacts* command : flattened(program)) {
    std::string words;
    for (const Candidate& candidate : candidates_of(program, *command))
      words += (words.empty() ? "" : " ") + candidate.word;
    if (command->takes_name()) words += std::string(" $(") + kLive + ")";
    script += "    \"" + command->path + "\") words=\"" + words + "\"" +
              (command->takes_file() ? " files=yes" : "") + " ;;\n";
  }
  return script +
         "  esac\n"
         "  COMPREPLY=($(compgen -W \"$words\" -- \"$current\"))\n"
         "  [[ -n $files ]] && COMPREPLY+=($(compgen -f -- \"$current\"))\n"
         "  [[ ${COMPREPLY[0]} == *= ]] && compopt -o nospace 2>/dev/null\n"
         "}\n"
         "complete -o filenames -F _rtpm rtpm\n";
}

std::string zsh_completion(const CommandFacts& program) {
  std::string script =
      "#compdef rtpm\n"
      "# Completion of rtpm for zsh; made by `rtpm completion zsh`.\n"
      "_rtpm() {\n"
      "  local command= target= word\n"
      "  local -a candidates names\n"
      "  for word in ${words[2,CURRENT-1]}; do\n"
      "    case \"$command $word\" in\n"
      "      (" +
      steps_of(program) + ") command=\"${command:+$command }$word\" ;;\n" + kTargetSteps +
      "    esac\n"
      "  done\n"
      "  case $command in\n";
  for (const CommandFacts* command : flattened(program)) {
    script += "    (\"" + command->path + "\")\n      candidates=(\n";
    for (const Candidate& candidate : candidates_of(program, *command))
      script += "        " + quoted(without_colons(candidate.word) + ":" + candidate.help) + "\n";
    script += "      )\n";
    if (command->takes_name()) {
      script += std::string("      names=($(") + kLive + "))\n      compadd -a names\n";
    }
    if (command->takes_file()) script += "      _files\n";
    script += "      ;;\n";
  }
  return script +
         "  esac\n"
         "  _describe rtpm candidates\n"
         "}\n"
         "if [ \"$funcstack[1]\" = _rtpm ]; then _rtpm \"$@\"; else compdef _rtpm rtpm; fi\n";
}

std::string fish_completion(const CommandFacts& program) {
  std::string script =
      "# Completion of rtpm for fish; made by `rtpm completion fish`.\n"
      "function __rtpm_command\n"
      "  set -l command ''\n"
      "  for word in (commandline -opc)[2..]\n"
      "    switch \"$command $word\"\n"
      "      case " +
      [&program] {
        std::string steps = steps_of(program);
        for (char& byte : steps)
          if (byte == '|') byte = ' ';
        return steps;
      }() +
      "\n"
      "        set command (string trim \"$command $word\")\n"
      "    end\n"
      "  end\n"
      "  echo $command\n"
      "end\n"
      "function __rtpm_live\n"
      "  set -l command (__rtpm_command)\n"
      "  set -l target ''\n"
      "  for word in (commandline -opc)[2..]\n"
      "    if test -z \"$target\"; and not string match -q -- '-*' $word\n"
      "      and not contains -- $word (string split ' ' -- $command)\n"
      "      set target $word\n"
      "    end\n"
      "  end\n"
      "  " +
      std::string(kLive) +
      "\n"
      "end\n"
      "complete -c rtpm -f\n";
  for (const CommandFacts* command : flattened(program)) {
    const std::string when =
        "complete -c rtpm -n 'test (__rtpm_command) = \"" + command->path + "\"'";
    for (const Candidate& candidate : candidates_of(program, *command)) {
      const bool is_option = candidate.word.starts_with("--");
      script += when + (is_option ? " -l " + candidate.word.substr(2) : " -a " + candidate.word) +
                " -d " + quoted(candidate.help) + "\n";
    }
    if (command->takes_name()) {
      script += when + " -a '(__rtpm_live)'\n";
    }
    if (command->takes_file()) script += when + " -F\n";
  }
  return script;
}

void add_completion(CLI::App& program, Context& context) {
  const auto request = std::make_shared<CompletionRequest>();
  CLI::App& command = add_command(
      program, context, "completion", "Print the script by which a shell completes rtpm",
      "  rtpm completion bash > ~/.local/share/bash-completion/completions/rtpm\n"
      "  rtpm completion zsh > \"${fpath[1]}/_rtpm\"\n"
      "  rtpm completion fish > ~/.config/fish/completions/rtpm.fish\n",
      [request, &program](Context& c) -> int {
        const std::string& shell = request->shell;
        if (shell.empty() && request->command.empty()) {
          return c.fail("SHELL is required", kMisused);
        }
        if (shell.empty()) return print_words(c, *request);
        const CommandFacts facts = facts_of(program);
        const std::string script = shell == "bash"  ? bash_completion(facts)
                                   : shell == "zsh" ? zsh_completion(facts)
                                                    : fish_completion(facts);
        if (c.json) {
          print_json({{"shell", shell}, {"script", script}});
        } else {
          std::fputs(script.c_str(), stdout);
        }
        return kDone;
      });
  CLI::Option* const shell = command.add_option("SHELL", request->shell, "bash, zsh or fish")
                                 ->check(CLI::IsMember({"bash", "zsh", "fish"}))
                                 ->type_name("");
  CLI::Option* const words =
      command
          .add_option("--words", request->command,
                      "Print the names, methods or parameters that may follow this command now")
          ->type_name("COMMAND")
          ->excludes(shell);
  command.add_option("--of", request->target, "The words of this object")
      ->type_name("TARGET")
      ->needs(words);
}

}  // namespace rtpm::tool
