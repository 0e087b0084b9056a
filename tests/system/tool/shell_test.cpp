#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "programs.hpp"
#include "shell_help.hpp"

// The shell's view of `rtpm`: its help, completion and manual page, from one source.
namespace rtpm::system_test {
namespace {

std::string output_of(const std::vector<std::string>& arguments) {
  const auto end = run_program("rtpm", arguments);
  EXPECT_EQ(end.exit_code, 0) << end.errors;
  return end.output;
}

TEST(Shell, SeesEveryCommandInTheManualPage) {
  const std::string page = output_of({"manual"});
  const auto commands = commands_below("");
  EXPECT_GE(commands.size(), 18u);
  for (const std::string& command : commands) {
    std::string escaped;
    for (const char byte : command)
      escaped += byte == '-' ? std::string("\\-") : std::string(1, byte);
    const bool has_own = !commands_below(command).empty();
    EXPECT_EQ(page.find("\n.SS " + escaped + (has_own ? "\n" : "")) == std::string::npos, has_own)
        << command;
  }
}

TEST(Shell, CompletesEveryCommand) {
  const auto commands = commands_below("");
  for (const char* shell : {"bash", "zsh", "fish"}) {
    const std::string script = output_of({"completion", shell});
    for (const std::string& command : commands)
      EXPECT_NE(script.find("\"" + command + "\""), std::string::npos) << shell << " " << command;
  }
}

/// Bash's completions for the last of `words`.
std::string completed(const std::string& words) {
  const auto script = std::filesystem::path(testing::TempDir()) / "rtpm-completion.bash";
  std::ofstream(script) << output_of({"completion", "bash"});
  const auto end =
      test::run({"bash", "-c",
                 "PATH=$0:$PATH; source " + script.string() + "; COMP_WORDS=(" + words +
                     "); COMP_CWORD=$((${#COMP_WORDS[@]} - 1)); _rtpm; echo "
                     "\"${COMPREPLY[*]}\"",
                 RTPM_PROGRAM_FOLDER},
                kPatience);
  EXPECT_TRUE(end);
  EXPECT_EQ(end->errors, "");
  return end->output;
}

TEST(Shell, CompletesCommandsOptionsAndChoicesInBash) {
  EXPECT_EQ(completed("rtpm est"), "estop\n");
  EXPECT_EQ(completed("rtpm config cal"), "calibrate\n");
  EXPECT_EQ(completed("rtpm --json config reset --rev"), "--revision\n");
  EXPECT_EQ(completed("rtpm take-over lab/arm0 rec"), "recover\n");
  EXPECT_EQ(completed("rtpm list --reg"), "--registry\n");
}

TEST(Shell, IsRefusedAnUnknownShellCommandOrOption) {
  expect_one_sentence(run_program("rtpm", {"completion", "tcsh"}), 2, {"tcsh", "bash,zsh,fish"});
  expect_one_sentence(run_program("rtpm", {"lsit"}), 2, {"'lsit'", "did you mean 'list'"});
  expect_one_sentence(run_program("rtpm", {"list", "--jsn"}), 2, {"'--jsn'", "'--json'"});
  expect_one_sentence(run_program("rtpm", {}), 2, {"a command is missing"});
  expect_one_sentence(run_program("rtpm", {"list", "--deadline", "2h"}), 2, {"1us to 1h"});
}

TEST(Shell, TakesItsRegistryFromTheEnvironment) {
  const auto end = test::run(
      {"env", "RTPM_REGISTRY=rtpm://127.0.0.1:1/elsewhere", path_of("rtpm"), "list"}, kPatience);
  ASSERT_TRUE(end);
  expect_one_sentence(*end, 3, {"rtpm://127.0.0.1:1/elsewhere"});
}

TEST(Shell, SeesNoColourWithoutATerminal) {
  for (const char* command : {"--help", "doctor", "lanes"})
    EXPECT_EQ(run_program("rtpm", {command}).output.find('\x1b'), std::string::npos) << command;
}

}  // namespace
}  // namespace rtpm::system_test
