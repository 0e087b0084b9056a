#include "laboratory/plan.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "rtpm/test/temporary_folder.hpp"

// A laboratory's file: its meaning, and the positions of its mistakes.
namespace rtpm::laboratory {
namespace {

using namespace std::chrono_literals;

constexpr const char* kProgram = "[[program]]\nname = \"a\"\nrun = [\"sh\"]\n";

/// A folder of programs that do nothing, so that no test depends on installed programs.
class File : public testing::Test {
 protected:
  void SetUp() override {
    std::filesystem::create_directories(folder_ / "bin");
    for (const char* name : {"rtpm-registryd", "rtpm-deviced", "rtpm-servo", "rtpm-display"}) {
      const auto path = folder_ / "bin" / name;
      std::ofstream(path) << "#!/bin/sh\n";
      ::chmod(path.c_str(), 0755);
    }
  }

  [[nodiscard]] expected<Plan, std::vector<SetupError>> read(const std::string& text) const {
    std::ofstream(path_) << text;
    return read_plan(path_, variables_, {folder_ / "bin", "/nowhere", "/bin"});
  }
  [[nodiscard]] Plan plan_of(const std::string& text) const {
    auto plan = read(text);
    if (plan) return std::move(*plan);
    for (const SetupError& error : plan.error())
      ADD_FAILURE() << error.text();
    return {.programs = std::vector<ProgramPlan>(8)};
  }
  /// The words of the program's command when the URLs are known.
  static Words command_of(Plan plan, std::size_t index, const Variables& urls = {}) {
    for (const auto& [name, url] : urls)
      plan.variables[name] = url;
    Words words;
    for (const std::string& word : plan.programs[index].command)
      words.push_back(expanded(word, plan.variables).value_or("?"));
    return words;
  }
  /// Expects exactly one mistake, at this position such as "4:8", whose text has all the words.
  void expect_mistake(const std::string& text, const std::string& position,
                      const Words& words) const {
    const auto plan = read(text);
    ASSERT_FALSE(plan) << text;
    ASSERT_EQ(plan.error().size(), 1u) << plan.error()[1].what << "\n" << text;
    const std::string shown = plan.error().front().text();
    EXPECT_TRUE(shown.starts_with(path_ + ":" + position + ": ")) << shown << "\n" << text;
    for (const std::string& word : words)
      EXPECT_NE(shown.find(word), std::string::npos) << word << " is not in: " << shown;
  }
  /// Like expect_mistake(), in the fourth line of an otherwise correct program.
  void expect_mistake_in(const std::string& line, int column, const Words& words) const {
    expect_mistake(kProgram + line + "\n", "4:" + std::to_string(column), words);
  }

  test::TemporaryFolder own_folder_;
  const std::filesystem::path folder_ = own_folder_.path();
  std::string path_ = own_folder_.file("cell.toml");
  Variables variables_{};
};

TEST_F(File, HasProgramsWithDefaults) {
  const Plan plan = plan_of(kProgram);
  EXPECT_EQ(plan.name, "cell");
  EXPECT_EQ(plan.folder, folder_);
  const ProgramPlan& program = plan.programs[0];
  EXPECT_EQ(program.path, "/bin/sh");
  EXPECT_FALSE(program.must_print_url || program.is_restarted);
  EXPECT_EQ(program.stop_patience, 2s);
}

TEST_F(File, SetsEveryKey) {
  const Plan plan = plan_of(R"(
[variables]
rate = "500"
[laboratory]
name = "arm-cell"
environment = {A = "1", B = "${rate}"}
[[program]]
name = "a"
run = ["sh", "${rate}", "$$x"]
environment = {B = "3"}
ready_line = "go"
ready_deadline = "500ms"
restart = "on-failure"
stop_patience = "5s"
output = "end"
main = true
needed = true
)");
  EXPECT_EQ(plan.name, "arm-cell");
  EXPECT_EQ(command_of(plan, 0), (Words{"sh", "500", "$x"}));
  const ProgramPlan& program = plan.programs[0];
  EXPECT_EQ(program.environment, (Variables{{"A", "1"}, {"B", "3"}}));
  EXPECT_EQ(program.ready_line, "go");
  EXPECT_EQ(program.ready_deadline, 500ms);
  EXPECT_EQ(program.output, Output::kEnd);
  EXPECT_TRUE(program.is_restarted && program.is_main && program.is_needed);
}

TEST_F(File, GivesTheRegistryToLaterPrograms) {
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
  EXPECT_TRUE(plan.programs[0].environment.empty());
  EXPECT_TRUE(plan.programs[1].must_print_url);
  EXPECT_EQ(plan.programs[2].after, Indices{1});
  EXPECT_EQ(plan.programs[2].environment, (Variables{{"RTPM_REGISTRY", "${registry.url}"}}));
  EXPECT_EQ(plan.programs[2].names, Words{"lab/arm0"});
}

TEST_F(File, StartsAProgramAfterThoseWhoseUrlItIsGiven) {
  const Plan plan = plan_of(
      "[[program]]\nname = \"b\"\nrun = [\"sh\", \"--hub=${a.url}!\"]\n"
      "[[program]]\nname = \"a\"\nrun = [\"sh\"]\nafter = []\n");
  EXPECT_EQ(plan.order, (Indices{1, 0}));
  EXPECT_EQ(command_of(plan, 0, {{"a.url", "rtpm://h"}})[1], "--hub=rtpm://h!");
  EXPECT_TRUE(plan.programs[1].must_print_url);
  EXPECT_EQ(plan.programs[0].uses, Indices{1});
}

TEST_F(File, LetsTheRegistryUseAnEarlierProgram) {
  const Plan plan = plan_of(
      "[[program]]\nname = \"store\"\nrun = [\"sh\"]\n"
      "[[program]]\nname = \"registry\"\n"
      "run = [\"rtpm-registryd\", \"--store\", \"${store.url}\"]\nafter = []\n");
  EXPECT_EQ(plan.order, (Indices{0, 1}));
}

TEST_F(File, TakesVariablesOfTheCommandLine) {
  const std::string file = std::string("[variables]\nrate = \"5\"\n") +
                           "[[program]]\nname = \"a\"\nrun = [\"sh\", \"${rate}\"]\n";
  variables_["rate"] = "7";
  EXPECT_EQ(command_of(plan_of(file), 0)[1], "7");
  variables_["raet"] = "8";
  expect_mistake(file, "1:1", {"raet", "did you mean 'rate'"});
}

TEST_F(File, PassesItsNameOnToProgramsWithAConfiguration) {
  const std::string config = "[program.config.device.arm0]\ndriver = \"arm\"\nrates = [1, \"2\"]\n";
  const Plan plan = plan_of(kProgram + config);
  const auto value = expanded(plan.programs[0].environment.at("RTPM_CONFIG"), plan.variables);
  EXPECT_EQ(value.value_or(""), path_ + "#a");
  expect_mistake(kProgram + config + "cpus = [\"${x}\"]\n", "7:9", {"'config'", "'environment'"});
}

TEST_F(File, ReportsWrongSyntax) {
  expect_mistake("[[program]]\nname = \"a\nrun = 1\n", "2:10", {"string"});
  expect_mistake("[laboratory]\nname = \"a\"\nname = \"b\"\n", "3:8", {"name"});
}

TEST_F(File, ReportsWrongKeysAndValues) {
  expect_mistake("", "1:1", {"no program", "[[program]]"});
  expect_mistake("[[program]]\nrun = [\"sh\"]\n", "1:1", {"'name' is missing"});
  expect_mistake("[[program]]\nname = \"a\"\n", "1:1", {"'run' is missing"});
  expect_mistake_in("restrat = \"never\"", 1, {"'restrat'", "did you mean 'restart'"});
  expect_mistake_in("restart = \"onfailure\"", 11, {"did you mean 'on-failure'", "never"});
  expect_mistake_in("restart = true", 11, {"'restart'", "boolean", "string"});
  expect_mistake_in("stop_patience = \"0s\"", 17, {"\"1ms\" to \"24h\""});
  expect_mistake_in("stop_patience = 2", 17, {"integer", "string"});
  expect_mistake_in("output = \"line\"", 10, {"did you mean 'lines'"});
  expect_mistake_in("serves = \"lines\"", 10, {"\"line\"", "[\"lab/arm0\"]"});
  expect_mistake_in("serves = [\"lab/arm0\", 3]", 23, {"integer"});
  expect_mistake_in("serves = []", 10, {"a list of names"});
  expect_mistake_in("one_shot = 1", 12, {"boolean"});
  expect_mistake_in("after = \"b\"", 9, {"'b'", "no program"});
  expect_mistake_in("environment = {A = 1}", 20, {"'A'", "string"});
  expect_mistake_in("environment = {A = \"${B}\"}", 20, {"${B}"});
  expect_mistake_in("environment = {A = \"${a.ulr}\"}", 20, {"did you mean 'a.url'"});
  expect_mistake_in("environment = {A = \"${environment.RTPM_ABSENT}\"}", 20, {"not set"});
  expect_mistake_in("environment = {A = \"${x\"}", 20, {"no '}'"});
  expect_mistake_in("optional = 1", 12, {"boolean"});
  expect_mistake("[laboratory]\nname = \"../x\"\n" + std::string(kProgram), "2:8", {"letters"});
  expect_mistake("[laboratory]\nnam = \"x\"\n" + std::string(kProgram), "2:1", {"'name'"});
  expect_mistake("[laborato]\n" + std::string(kProgram), "1:2", {"did you mean 'laboratory'"});
  expect_mistake("[variables]\nx = 1\n" + std::string(kProgram), "2:5", {"integer", "string"});
  expect_mistake(std::string(kProgram) + kProgram, "5:8", {"two programs", "'a'"});
  expect_mistake("program = 3\n", "1:11", {"integer", "array"});
  expect_mistake_in("output = \"terminal\"\nready_line = \"x\"", 10, {"no line is read"});
}

TEST_F(File, ReportsProgramsThatAreNotInstalled) {
  expect_mistake("[[program]]\nname = \"a\"\nrun = [\"rtpm-nothing\"]\n", "3:8",
                 {"rtpm-nothing", folder_ / "bin", "/nowhere, /bin"});
  expect_mistake("[[program]]\nname = \"a\"\nrun = [\"./tool\"]\n", "3:8", {"'./tool'"});
}

TEST_F(File, LeavesOutAnOptionalProgramThatIsNotInstalled) {
  const Plan plan = plan_of(
      std::string(kProgram) +
      "[[program]]\nname = \"extra\"\nrun = [\"rtpm-nothing\"]\noptional = true\n"
      "[[program]]\nname = \"b\"\nrun = [\"sh\"]\n"
      "[[program]]\nname = \"c\"\nrun = [\"sh\"]\nafter = [\"a\", \"extra\"]\noptional = true\n");
  EXPECT_EQ(plan.left_out, Words{"extra"});
  ASSERT_EQ(plan.programs.size(), 3u);
  EXPECT_EQ(plan.programs[1].after, Indices{0});
  EXPECT_EQ(plan.programs[2].after, Indices{0});
}

TEST_F(File, NamesProgramsThatWaitForEachOther) {
  expect_mistake(
      "[[program]]\nname = \"a\"\nrun = [\"sh\"]\nafter = \"b\"\n"
      "[[program]]\nname = \"b\"\nrun = [\"sh\"]\n"
      "[[program]]\nname = \"c\"\nrun = [\"sh\"]\n",
      "4:9", {"'a', 'b' wait for each other"});
  expect_mistake_in("after = \"a\"", 9, {"'a' waits for itself"});
  expect_mistake(
      "[[program]]\nname = \"a\"\nrun = [\"sh\", \"${b.url}\"]\n"
      "[[program]]\nname = \"b\"\nrun = [\"sh\", \"${a.url}\"]\n",
      "1:1", {"wait for each other"});
}

TEST_F(File, ReportsAllMistakesInOrder) {
  const auto plan = read(std::string(kProgram) + "main = 1\nx = 2\nafter = \"y\"\n");
  ASSERT_FALSE(plan);
  ASSERT_EQ(plan.error().size(), 3u);
  for (std::size_t i = 0; i < 3; ++i)
    EXPECT_NE(plan.error()[i].what.find(":" + std::to_string(4 + i) + ":"), std::string::npos);
}

/// The file in a document: its block that starts with ```toml.
std::string block_in(const std::string& path) {
  std::ifstream file(path);
  const std::string text{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  const std::size_t begin = text.find("```toml\n");
  if (begin == std::string::npos) return {};
  return text.substr(begin + 8, text.find("```", begin + 8) - begin - 8);
}

TEST_F(File, IsValidInTheDocument) {
  EXPECT_GE(plan_of(block_in(RTPM_TOOL_FOLDER "/README.md")).programs.size(), 3u);
}

TEST_F(File, IsValidForTheDemo) {
  const auto plan = read_plan(RTPM_TOOL_FOLDER "/laboratory/demo.toml", {}, {folder_ / "bin"});
  ASSERT_TRUE(plan) << plan.error().front().text();
  EXPECT_EQ(plan->name, "demo");
  EXPECT_EQ(plan->left_out, Words{"console"});
}

// Deeper nesting would overflow the stack in the TOML library.
TEST_F(File, RefusesTablesThatMayNestTooDeeply) {
  std::string deep = "a";
  for (int i = 0; i < 20'000; ++i)
    deep += ".a";
  for (const std::string& text : {deep + " = 1\n", "[" + deep + "]\n", "[[" + deep + "]]\n"})
    expect_mistake(text, "1:1", {"4096 dots", "nest too deeply"});
  expect_mistake("a = " + std::string(20'000, '[') + "\n", "1:261", {"nested"});
}

}  // namespace
}  // namespace rtpm::laboratory
