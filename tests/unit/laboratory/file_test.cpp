#include "laboratory/file.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <csignal>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

// The meaning of a laboratory's file, and the places where its mistakes are reported.
namespace rtpm::laboratory {
namespace {

using namespace std::chrono_literals;

/// A folder of programs that do nothing, so that no test depends on installed programs.
class File : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::path(testing::TempDir()) / "rtpm-laboratory";
    std::filesystem::create_directories(folder_ / "bin");
    for (const char* name : {"rtpm-registryd", "rtpm-deviced", "rtpm-servo", "rtpm-display"}) {
      const auto path = folder_ / "bin" / name;
      std::ofstream(path) << "#!/bin/sh\n";
      ::chmod(path.c_str(), 0755);
    }
    context_.folders = {.own = folder_ / "bin", .path = {"/nowhere", "/bin"}};
  }

  [[nodiscard]] expected<Plan, std::vector<Mistake>> parse(const std::string& text) const {
    return parse_plan(text, folder_ / "cell.toml", context_);
  }
  [[nodiscard]] Plan plan_of(const std::string& text) const {
    auto plan = parse(text);
    if (plan) return std::move(*plan);
    for (const Mistake& mistake : plan.error())
      ADD_FAILURE() << mistake.position.line << ":" << mistake.position.column << ": "
                    << mistake.what;
    return {};
  }
  /// Expects exactly one mistake, at this position, whose text contains all the words.
  void expect_mistake(const std::string& text, std::uint32_t line, std::uint32_t column,
                      const std::vector<std::string>& words) const {
    const auto plan = parse(text);
    ASSERT_FALSE(plan) << text;
    ASSERT_EQ(plan.error().size(), 1u) << plan.error()[1].what << "\n" << text;
    const Mistake& mistake = plan.error().front();
    const std::string told = mistake.what + "; " + mistake.remedy;
    EXPECT_EQ(mistake.position.line, line) << told << "\n" << text;
    EXPECT_EQ(mistake.position.column, column) << told << "\n" << text;
    for (const std::string& word : words)
      EXPECT_NE(told.find(word), std::string::npos) << word << " is not in: " << told;
  }
  /// Like expect_mistake(), for the fourth line of an otherwise correct program.
  void expect_mistake_in(const std::string& line, std::uint32_t column,
                         const std::vector<std::string>& words) const {
    expect_mistake("[[program]]\nname = \"a\"\nrun = [\"sh\"]\n" + line + "\n", 4, column, words);
  }

  std::filesystem::path folder_;
  FileContext context_{};
};

TEST_F(File, HasProgramsWithDefaults) {
  const Plan plan = plan_of("[[program]]\nname = \"a\"\nrun = [\"sh\", \"-c\", \"true\"]\n");
  EXPECT_EQ(plan.name, "cell");
  ASSERT_EQ(plan.programs.size(), 1u);
  const ProgramPlan& program = plan.programs[0];
  EXPECT_EQ(program.path, "/bin/sh");
  EXPECT_EQ(program.folder, folder_);
  EXPECT_EQ(program.command[2].resolved({}), "true");
  EXPECT_EQ(program.readiness, Readiness::kStart);
  EXPECT_EQ(program.restart, Restart::kNever);
  EXPECT_EQ(program.restart_limit, 5u);
  EXPECT_EQ(program.stop_patience, 2s);
  EXPECT_EQ(program.stop_signal, SIGTERM);
}

TEST_F(File, SetsEveryKey) {
  const Plan plan = plan_of(R"(
[variables]
rate = 500
[laboratory]
name = "arm-cell"
logs = "logs"
registry = "rtpm://10.0.0.1:7420/rtpm/names"
environment = {A = "1", B = "${rate}"}
[[program]]
name = "a"
run = ["sh", "${rate}", "$$x"]
folder = "bin"
environment = {B = "3"}
ready_line = "go"
ready_deadline = "500ms"
restart = "always"
restart_limit = 0
restart_window = "10s"
restart_delay = "1s"
restart_delay_max = "2s"
stop_patience = "5s"
stop_signal = "INT"
output = "end"
main = true
needed = true
)");
  EXPECT_EQ(plan.name, "arm-cell");
  EXPECT_EQ(plan.log_folder, folder_ / "logs");
  EXPECT_EQ(plan.registry_url, "rtpm://10.0.0.1:7420/rtpm/names");
  ASSERT_EQ(plan.programs.size(), 1u);
  const ProgramPlan& program = plan.programs[0];
  EXPECT_EQ(program.command[1].resolved({}), "500");
  EXPECT_EQ(program.command[2].resolved({}), "$x");
  EXPECT_EQ(program.folder, folder_ / "bin");
  ASSERT_EQ(program.environment.size(), 2u);
  EXPECT_EQ(program.environment[1].second.resolved({}), "3");
  EXPECT_EQ(program.readiness, Readiness::kLine);
  EXPECT_EQ(program.ready_deadline, 500ms);
  EXPECT_EQ(program.restart, Restart::kAlways);
  EXPECT_EQ(program.restart_limit, 0u);
  EXPECT_EQ(program.stop_signal, SIGINT);
  EXPECT_EQ(program.output, Output::kEnd);
  EXPECT_TRUE(program.is_main && program.is_needed);
}

TEST_F(File, GivesTheRegistryToProgramsThatDoNotComeBeforeIt) {
  const Plan plan = plan_of(R"(
[[program]]
name = "clean"
run = ["sh"]
one_shot = true
[[program]]
name = "registry"
run = ["rtpm-registryd", "--port", "0"]
[[program]]
name = "devices"
run = ["rtpm-deviced"]
serves = ["lab/arm0"]
after = []
)");
  ASSERT_EQ(plan.programs.size(), 3u);
  EXPECT_EQ(plan.registry_program, 1u);
  EXPECT_EQ(plan.programs[1].readiness, Readiness::kUrl);
  EXPECT_TRUE(plan.programs[0].environment.empty());
  EXPECT_EQ(plan.programs[2].after, std::vector<std::size_t>{1});
  ASSERT_EQ(plan.programs[2].environment.size(), 1u);
  EXPECT_EQ(plan.programs[2].environment[0].first, "RTPM_REGISTRY");
  EXPECT_EQ(plan.programs[2].environment[0].second.resolved({"", "rtpm://x", ""}), "rtpm://x");
}

TEST_F(File, StartsAProgramBehindThoseWhoseUrlItIsGiven) {
  const Plan plan = plan_of(R"(
[[program]]
name = "b"
run = ["sh", "--hub=${a.url}!"]
[[program]]
name = "a"
run = ["sh"]
after = []
)");
  ASSERT_EQ(plan.order, (std::vector<std::size_t>{1, 0}));
  EXPECT_EQ(plan.programs[0].command[1].resolved({"", "rtpm://h"}), "--hub=rtpm://h!");
  EXPECT_EQ(plan.programs[1].readiness, Readiness::kUrl);
  EXPECT_EQ(plan.programs[0].uses, std::vector<std::size_t>{1});
}

TEST_F(File, TakesVariablesOfTheCommandLine) {
  context_.variables["rate"] = "7";
  const std::string program = "[[program]]\nname = \"a\"\nrun = [\"sh\", \"${rate}\"]\n";
  EXPECT_EQ(plan_of("[variables]\nrate = 5\n" + program).programs[0].command[1].resolved({}), "7");
  context_.variables["raet"] = "8";
  expect_mistake("[variables]\nrate = 5\n" + program, 1, 1, {"raet", "did you mean 'rate'"});
}

TEST_F(File, TellsWhereItsSyntaxIsWrong) {
  expect_mistake("[[program]]\nname = \"a\nrun = 1\n", 2, 10, {"string"});
  expect_mistake("[laboratory]\nname = \"a\"\nname = \"b\"\n", 3, 8, {"name"});
}

TEST_F(File, TellsWhereAKeyOrValueIsWrong) {
  expect_mistake("", 1, 1, {"no program", "[[program]]"});
  expect_mistake("[[program]]\nrun = [\"sh\"]\n", 1, 1, {"no 'name'"});
  expect_mistake("[[program]]\nname = \"a\"\n", 1, 1, {"'run' is missing"});
  expect_mistake_in("restrat = \"never\"", 1, {"'restrat'", "did you mean 'restart'"});
  expect_mistake_in("restart = \"onfailure\"", 11, {"on-failure", "program 'a'", "\"always\""});
  expect_mistake_in("restart = true", 11, {"true", "a text"});
  expect_mistake_in("restart_limit = 1001", 17, {"1001", "from 0 to 1000"});
  expect_mistake_in("restart_limit = -1", 17, {"-1", "from 0 to 1000"});
  expect_mistake_in("restart_limit = 1.5", 17, {"fraction"});
  expect_mistake_in("stop_patience = \"20min\"", 17, {"20min", "\"0s\" to \"10min\""});
  expect_mistake_in("stop_patience = 2", 17, {"the number 2", "\"10min\""});
  expect_mistake_in("stop_signal = \"KILL\"", 15, {"TERM"});
  expect_mistake_in("output = \"line\"", 10, {"did you mean 'lines'"});
  expect_mistake_in("serves = \"lines\"", 10, {"\"line\"", "[\"lab/arm0\"]"});
  expect_mistake_in("serves = [\"lab/arm0\", 3]", 23, {"the number 3"});
  expect_mistake_in("serves = []", 10, {"a list of names"});
  expect_mistake_in("ready_line = \"\"", 14, {"empty"});
  expect_mistake_in("one_shot = 1", 12, {"true or false"});
  expect_mistake_in("after = \"b\"", 9, {"\"b\"", "no program"});
  expect_mistake_in("after = [\"a\", 2]", 15, {"the number 2"});
  expect_mistake_in("folder = \"nowhere\"", 10, {"no folder", "nowhere"});
  expect_mistake_in("environment = {A = 1}", 20, {"'A'", "a text"});
  expect_mistake_in("environment = {A = \"${B}\"}", 20, {"${B}"});
  expect_mistake_in("environment = {A = \"${a.ulr}\"}", 20, {"did you mean 'a.url'"});
  expect_mistake_in("environment = {A = \"${environment.RTPM_ABSENT}\"}", 20, {"not set"});
  expect_mistake_in("environment = {A = \"${x\"}", 20, {"no '}'"});
  expect_mistake_in("folder = \"${a.url}\"", 10, {"'run' and 'environment' only"});
  expect_mistake_in("restart_delay = \"1min\"", 17, {"longer than 'restart_delay_max'"});
}

TEST_F(File, TellsWhereKeysContradictEachOther) {
  const std::string program = "[[program]]\nname = \"a\"\nrun = [\"sh\"]\n";
  expect_mistake(program + "serves = \"line\"\nready_line = \"x\"\n", 5, 14, {"exclude"});
  expect_mistake(program + "one_shot = true\nrestart = \"always\"\n", 5, 11, {"on-failure"});
  expect_mistake(program + "output = \"terminal\"\nready_line = \"x\"\n", 4, 10, {"not read"});
}

TEST_F(File, TellsWhereItsLaboratoryIsWrong) {
  const std::string program = "[[program]]\nname = \"a\"\nrun = [\"sh\"]\n";
  expect_mistake("[laboratory]\nname = \"../x\"\n" + program, 2, 8, {"letters"});
  expect_mistake("[laboratory]\nnam = \"x\"\n" + program, 2, 1, {"did you mean 'name'"});
  expect_mistake("[laboratory]\nregistry = \"b\"\n" + program, 2, 12, {"'b'", "rtpm://host"});
  expect_mistake("[laborato]\n" + program, 1, 2, {"did you mean 'laboratory'"});
  expect_mistake("[variables]\nx = []\n" + program, 2, 5, {"a list"});
  expect_mistake(program + program, 5, 8, {"two programs", "'a'"});
  expect_mistake("program = 3\n", 1, 11, {"the number 3"});
}

TEST_F(File, TellsWhereAProgramWasLookedFor) {
  expect_mistake("[[program]]\nname = \"a\"\nrun = [\"rtpm-nothing\"]\n", 3, 8,
                 {"rtpm-nothing", folder_ / "bin", "beside rtpm", "PATH", "/nowhere /bin"});
  expect_mistake("[[program]]\nname = \"a\"\nrun = [\"./tool\"]\n", 3, 8, {folder_ / "tool"});
}

TEST_F(File, LeavesOutAnOptionalProgramThatIsNotInstalled) {
  const std::string text =
      "[[program]]\nname = \"a\"\nrun = [\"sh\"]\n"
      "[[program]]\nname = \"extra\"\nrun = [\"rtpm-nothing\"]\noptional = true\n"
      "[[program]]\nname = \"b\"\nrun = [\"sh\"]\n"
      "[[program]]\nname = \"c\"\nrun = [\"sh\"]\nafter = [\"a\", \"extra\"]\noptional = true\n";
  const Plan plan = plan_of(text);
  EXPECT_EQ(plan.left_out, std::vector<std::string>{"extra"});
  ASSERT_EQ(plan.programs.size(), 3u);
  EXPECT_EQ(plan.programs[1].after, std::vector<std::size_t>{0});
  EXPECT_EQ(plan.programs[2].after, std::vector<std::size_t>{0});
  expect_mistake_in("optional = 1", 12, {"true or false"});
}

TEST_F(File, TellsWhichProgramsWaitForEachOther) {
  expect_mistake(
      "[[program]]\nname = \"a\"\nrun = [\"sh\"]\nafter = \"b\"\n"
      "[[program]]\nname = \"b\"\nrun = [\"sh\"]\n",
      4, 9, {"'a'", "'b'", "wait for each other"});
  expect_mistake_in("after = \"a\"", 9, {"waits for itself"});
  expect_mistake(
      "[[program]]\nname = \"a\"\nrun = [\"sh\", \"${b.url}\"]\n"
      "[[program]]\nname = \"b\"\nrun = [\"sh\", \"${a.url}\"]\n",
      1, 1, {"wait for each other"});
}

TEST_F(File, StartsWhatTheRegistryIsGivenBeforeIt) {
  const Plan plan = plan_of(R"(
[[program]]
name = "store"
run = ["sh"]
[[program]]
name = "registry"
run = ["rtpm-registryd", "--store", "${store.url}"]
after = []
)");
  EXPECT_EQ(plan.order, (std::vector<std::size_t>{0, 1}));
}

TEST_F(File, TellsAllMistakesInOrder) {
  const auto plan =
      parse("[[program]]\nname = \"a\"\nrun = [\"sh\"]\nmain = 1\nx = 2\noutput = 3\n");
  ASSERT_FALSE(plan);
  ASSERT_EQ(plan.error().size(), 3u);
  for (std::uint32_t i = 0; i < 3; ++i)
    EXPECT_EQ(plan.error()[i].position.line, 4 + i);
}

TEST_F(File, IsToldByItsName) {
  const auto path = (folder_ / "wrong.toml").string();
  std::ofstream(path) << "[[program]]\nname = 1\nrun = [\"sh\"]\n";
  const auto plan = read_plan(path, context_);
  ASSERT_FALSE(plan);
  EXPECT_TRUE(plan.error()[0].what.starts_with(path + ":2:8: ")) << plan.error()[0].what;
  const auto absent = read_plan((folder_ / "absent.toml").string(), context_);
  ASSERT_FALSE(absent);
  EXPECT_NE(absent.error()[0].text().find("No such file"), std::string::npos);
}

/// The file in a document: its block that starts with ```toml.
std::string block_in(const std::string& path) {
  std::ifstream file(path);
  const std::string text{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  const std::size_t begin = text.find("```toml\n");
  if (begin == std::string::npos) return {};
  return text.substr(begin + 8, text.find("```", begin + 8) - begin - 8);
}

TEST_F(File, OfTheDocumentIsRight) {
  const Plan plan = plan_of(block_in(RTPM_TOOL_FOLDER "/README.md"));
  EXPECT_GE(plan.programs.size(), 3u);
}

TEST_F(File, OfTheDemoIsRight) {
  const Plan plan = [&] {
    auto read = read_plan(RTPM_TOOL_FOLDER "/laboratory/demo.toml", context_);
    return read ? std::move(*read) : Plan{};
  }();
  EXPECT_EQ(plan.name, "demo");
  EXPECT_EQ(plan.programs.size() + plan.left_out.size(), 5u);
  EXPECT_TRUE(plan.has_terminal());
}

std::string times(std::size_t count, const std::string& text) {
  std::string all;
  for (std::size_t i = 0; i < count; ++i)
    all += text;
  return all;
}

// Deeper nesting would overflow the stack in the parser or in the destructor of its tables.
TEST_F(File, ThatNestsTooDeeplyIsRefused) {
  const std::vector<std::string> deep{
      "a" + times(20'000, ".a") + " = 1\n",
      "[a" + times(20'000, ".a") + "]\n",
      "[[a" + times(20'000, ".a") + "]]\n",
      "a = " + times(20'000, "[") + times(20'000, "]") + "\n",
      "a = " + times(200, "{a = ") + "1" + times(200, "}") + "\n",
      "[a" + times(30, ".a") + "]\nb" + times(30, ".b") + " = [[[[[1]]]]]\n",
      "a = " + times(30, "{a.a.a = ") + "1" + times(30, "}") + "\n",
      "a = {b = \"}\", c" + times(64, ".c") + " = 1}\n"};
  for (const std::string& text : deep) {
    const auto plan = parse(text);
    ASSERT_FALSE(plan) << text.substr(0, 80);
    EXPECT_NE(plan.error().front().what.find("nest deeper than 64"), std::string::npos)
        << plan.error().front().what;
  }
  EXPECT_EQ(parse("\n\na" + times(20'000, ".a") + " = 1\n").error().front().position.line, 3u);
}

TEST_F(File, MayHaveBracketsAndDotsInTexts) {
  const std::string many = times(100, "[.{");
  const std::string quotes = "\"\"\"";
  const std::string ticks = "'''";
  const auto plan =
      parse("[variables]\na = \"" + many + "\\\"" + many + "\"\nb = '" + many + "'\nc = " + quotes +
            many + "\n\"" + many + quotes + "\nd = " + ticks + many + "\n" + many + ticks + "\n# " +
            many + "\n[[program]]\nname = \"a\"\nrun = [\"rtpm-servo\"]\n");
  ASSERT_TRUE(plan) << plan.error().front().what << plan.error().front().position.line;
}

}  // namespace
}  // namespace rtpm::laboratory
