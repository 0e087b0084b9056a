#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>
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
/// @param deadline  how long the running system may take to answer
std::string completed(const std::string& words, const std::string& registry = "",
                      const std::string& deadline = "300ms") {
  const auto script = std::filesystem::path(testing::TempDir()) / "rtpm-completion.bash";
  std::string text = output_of({"completion", "bash"});
  constexpr std::string_view kDeadline = "--deadline 300ms";
  for (std::size_t at = text.find(kDeadline); at != text.npos; at = text.find(kDeadline, at + 1))
    text.replace(at, kDeadline.size(), "--deadline " + deadline);
  std::ofstream(script) << text;
  const auto end =
      test::run({"bash", "-c",
                 (registry.empty() ? "" : "export RTPM_REGISTRY=" + registry + "; ") +
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

class LiveShell : public Laboratory {};

TEST_F(LiveShell, CompletesNamesMethodsAndParameters) {
  const auto now = [this](const std::string& words) {
    return completed(words, registry_->url, "20s");  // A busy machine takes its time.
  };
  EXPECT_EQ(now("rtpm call lab/"), "lab/arm0\n");
  EXPECT_EQ(now("rtpm call lab/arm0 emer"), "emergency_stop\n");
  EXPECT_EQ(now("rtpm --json config get lab/arm0 safety.ramp"), "safety.ramp_s\n");
  EXPECT_EQ(now("rtpm config set lab/arm0 safety.ramp"), "safety.ramp_s=\n");
  EXPECT_EQ(now("rtpm config calibrate lab/arm0 enc"), "encoder_offset\n");
  EXPECT_EQ(now("rtpm call lab/arm7 r"), "\n");
}

TEST(Shell, CompletesNothingAndQuicklyWithoutARegistry) {
  const auto begin = std::chrono::steady_clock::now();
  EXPECT_EQ(completed("rtpm call lab/", "rtpm://192.0.2.1:7420/rtpm/names"), "\n");
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds{5});
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
