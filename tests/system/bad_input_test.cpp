#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "programs.hpp"
#include "rtpm/test/os.hpp"

// A program reports anything wrong in its environment in one sentence with the remedy, and ends.
namespace rtpm::system_test {
namespace {

class EveryProgram : public testing::TestWithParam<const char*> {};

TEST_P(EveryProgram, RefusesAnUnknownFlag) {
  const auto end = run_program(GetParam(), {"--no-such-flag"});
  expect_one_sentence(end, 2, {GetParam(), "--no-such-flag", "--help"});
  EXPECT_EQ(end.output, "");
}

TEST_P(EveryProgram, RefusesAnUnknownKeyInItsFile) {
  const auto file = std::filesystem::path(testing::TempDir()) / (std::string(GetParam()) + ".toml");
  std::ofstream(file) << "no-such-key = 1\n";
  const auto end = run_program(GetParam(), {"--config", file.string()});
  expect_one_sentence(end, 2, {GetParam(), ".toml:1:", "no-such-key"});
  std::filesystem::remove(file);
}

TEST_P(EveryProgram, PrintsItsHelpAndVersion) {
  const auto help = run_program(GetParam(), {"--help"});
  EXPECT_EQ(help.exit_code, 0);
  EXPECT_NE(help.output.find("--config"), std::string::npos) << help.output;
  EXPECT_EQ(help.errors, "");
  const auto version = run_program(GetParam(), {"--version"});
  EXPECT_EQ(version.exit_code, 0);
  EXPECT_NE(version.output.find("0.1.0"), std::string::npos) << version.output;
}

INSTANTIATE_TEST_SUITE_P(Programs, EveryProgram,
                         testing::Values("rtpm-registryd", "rtpm-deviced", "rtpm-servo"),
                         [](const auto& parameter) {
                           const std::string name = parameter.param;
                           return name.substr(name.find('-') + 1);
                         });

// All programs of a shell share its environment.
TEST(Variables, HaveOneMeaningInAllPrograms) {
  std::map<std::string, std::string> meanings;  // The variables' meanings, each with its program.
  for (const char* program : {"rtpm-registryd", "rtpm-deviced", "rtpm-eventd", "rtpm-servo",
                              "rtpm-display", "rtpm-figure5"}) {
    std::istringstream lines(run_program(program, {"--dump-config"}).output);
    for (std::string line; std::getline(lines, line);) {
      const std::size_t begin = line.find(" [RTPM_");
      if (!line.starts_with("# ") || begin == std::string::npos) continue;
      const std::string variable = line.substr(begin + 2, line.find(']', begin) - begin - 2);
      const std::string meaning = line.substr(2, begin - 2);
      EXPECT_EQ(meanings.emplace(variable, meaning).first->second, meaning)
          << variable << " of " << program;
    }
  }
  EXPECT_GT(meanings.size(), 100u);
  EXPECT_TRUE(meanings.contains("RTPM_REGISTRY"));
  EXPECT_FALSE(meanings.contains("RTPM_DEADLINE")) << "that is the tool's";
}

/// A command in front of a program that limits its address space to this many bytes.
std::vector<std::string> with_memory(std::size_t size_max, std::vector<std::string> command) {
  command.insert(command.begin(), {"prlimit", "--core=0", "--as=" + std::to_string(size_max)});
  return command;
}

constexpr std::size_t kMiB = std::size_t{1} << 20;
constexpr int kNotLoaded = 127;  // The exit code if the system can't load a program's libraries.
constexpr const char* kSanitizersTakeAllAddresses = "sanitizers take all addresses for themselves";

TEST(OutOfMemory, EndsADaemonWithItsRemedy) {
  if (test::kHasSanitizer) GTEST_SKIP() << kSanitizersTakeAllAddresses;
  const std::vector<std::vector<std::string>> commands{
      {path_of("rtpm-registryd")},
      {path_of("rtpm-deviced"), "--registry", "rtpm://127.0.0.1:1/rtpm/names"},
      {path_of("rtpm-eventd"), "--name="}};
  for (std::vector<std::string> command : commands) {
    command.insert(command.end(), {"--port", "0", "--realtime", "off"});
    int failure_count = 0;
    for (const std::size_t size : {13 * kMiB, 16 * kMiB, 40 * kMiB, 60 * kMiB, 120 * kMiB}) {
      const auto end = test::run(with_memory(size, command), kPatience);
      ASSERT_TRUE(end) << command.front() << " serves with " << size << " bytes";
      if (end->exit_code == kNotLoaded) continue;
      ++failure_count;
      expect_one_sentence(*end, 1, {"Remedy: raise the limit", "ulimit -v"});
    }
    EXPECT_GT(failure_count, 2) << "this tries too little";
  }
}

TEST(OutOfMemory, EndsTheCompilerWithItsRemedy) {
  if (test::kHasSanitizer) GTEST_SKIP() << kSanitizersTakeAllAddresses;
  const auto file = std::filesystem::path(testing::TempDir()) / "large.fbs";
  std::ofstream schema(file);
  schema << "namespace large;\n";
  for (int i = 0; i < 20'000; ++i)
    schema << "table T" << i << " { a:int; b:double; c:string; }\n";
  schema.close();
  const auto end = test::run(
      with_memory(24 * kMiB, {path_of("rtpmc"), "--cpp", "-o", testing::TempDir(), file.string()}),
      kPatience);
  ASSERT_TRUE(end);
  expect_one_sentence(*end, 1, {"rtpmc: out of memory", "Remedy"});
  std::filesystem::remove(file);
}

class OutOfMemoryLaboratory : public Laboratory {};

TEST_F(OutOfMemoryLaboratory, EndsAClientWithOneSentence) {
  if (test::kHasSanitizer) GTEST_SKIP() << kSanitizersTakeAllAddresses;
  const std::vector<std::vector<std::string>> commands{
      {path_of("rtpm-servo"), "--registry", registry_->url, "--realtime", "off", "--seconds", "0.1",
       "--live", "off"},
      {path_of("rtpm"), "--registry", registry_->url, "info", "lab/arm0"}};
  for (const std::vector<std::string>& command : commands) {
    int failure_count = 0;
    // From the size that the system takes to begin with a program, as far as the memory suffices.
    for (std::size_t size = 8 * kMiB; size < 40 * kMiB; size += kMiB / 8) {
      const auto end = test::run(with_memory(size, command), kPatience);
      ASSERT_TRUE(end);
      if (end->exit_code == kNotLoaded) continue;
      if (end->exit_code == 0) break;
      ++failure_count;
      expect_one_sentence(*end, 1, {std::filesystem::path(command.front()).filename().string()});
    }
    EXPECT_GT(failure_count, 0) << "this tries nothing";
  }
}

class FewDescriptors : public Laboratory {};

TEST_F(FewDescriptors, AreNamedAsTheCauseOfAFailure) {
  const std::vector<std::vector<std::string>> commands{
      {path_of("rtpm"), "--registry", registry_->url, "info", "lab/arm0"},
      {path_of("rtpm-servo"), "--registry", registry_->url, "--realtime", "off", "--seconds", "0.1",
       "--live", "off"},
      {path_of("rtpm-deviced"), "--registry", registry_->url, "--realtime", "off", "--port", "0",
       "--devices", "arm1"}};
  for (const std::vector<std::string>& command : commands) {
    for (int count = 4; count <= 24; count += 2) {
      std::vector<std::string> whole{"prlimit", "--nofile=" + std::to_string(count)};
      whole.insert(whole.end(), command.begin(), command.end());
      test::Process process(whole);
      if (process.wait_for_output("rtpm://", kPatience)) break;  // The program serves.
      const auto end = process.wait(kPatience);
      ASSERT_TRUE(end);
      if (end->exit_code == 0) break;
      if (end->exit_code == kNotLoaded) continue;
      expect_one_sentence(*end, 1, {"oo many open files", "ulimit -n"});
    }
  }
}

TEST(BadSurroundings, NameABusyPort) {
  const auto registry = start_daemon("rtpm-registryd", {"--port", "0", "--realtime", "off"});
  ASSERT_TRUE(registry);
  const std::string port = std::to_string(registry->port());
  const auto end = run_program("rtpm-registryd", {"--port", port, "--realtime", "off"});
  expect_one_sentence(end, 1, {"rtpm-registryd", port, "in use"});
}

TEST(BadSurroundings, NameAMissingRegistry) {
  // A port that was free a moment ago; no program serves it.
  const std::string url = [] {
    const auto registry = start_daemon("rtpm-registryd", {"--port", "0", "--realtime", "off"});
    return registry ? registry->url : std::string();
  }();
  ASSERT_NE(url, "");
  const std::string address = url.substr(7, url.find('/', 7) - 7);
  const auto device =
      run_program("rtpm-deviced", {"--port", "0", "--registry", url, "--realtime", "off"});
  expect_one_sentence(device, 1, {"rtpm-deviced", address, "registry"});
  const auto servo = run_program("rtpm-servo", {"--registry", url, "--realtime", "off"});
  expect_one_sentence(servo, 1, {"rtpm-servo", address, "registry"});
}

TEST(BadSurroundings, NameAnUnknownName) {
  const auto registry = start_daemon("rtpm-registryd", {"--port", "0", "--realtime", "off"});
  ASSERT_TRUE(registry);
  const auto end = run_program(
      "rtpm-servo", {"--registry", registry->url, "--device", "lab/nobody", "--realtime", "off"});
  expect_one_sentence(end, 1, {"rtpm-servo", "lab/nobody"});
}

TEST(BadSurroundings, NameABrokenRecordingAndItsLine) {
  const auto file = std::filesystem::path(testing::TempDir()) / "rtpm_broken_hand.csv";
  std::ofstream(file) << "t_s,x_m,y_m,z_m\n0,0,0,0\n0.1,zero,0,0\n";
  const auto end = run_program("rtpm-deviced", {"--port", "0", "--registry", "none", "--realtime",
                                                "off", "--device-arm0-hand", file.string()});
  expect_one_sentence(end, 1, {"rtpm-deviced", "rtpm_broken_hand.csv:3"});
  std::filesystem::remove(file);
}

/// A command in front of a program that takes away its right to SCHED_FIFO and to locked memory.
std::vector<std::string> without_rights(const std::vector<std::string>& command) {
  std::vector<std::string> whole;
  if (geteuid() == 0) {
    whole = {"setpriv", "--bounding-set=-sys_nice,-ipc_lock,-sys_resource",
             "--inh-caps=-sys_nice,-ipc_lock,-sys_resource"};
  }
  whole.insert(whole.end(), {"prlimit", "--rtprio=0:0", "--memlock=65536:65536"});
  whole.insert(whole.end(), command.begin(), command.end());
  return whole;
}

class WithoutRealtimeRights : public testing::Test {
 protected:
  void SetUp() override {
    const auto tried = test::run(without_rights({"true"}), kPatience);
    if (!tried || tried->exit_code != 0) {
      GTEST_SKIP() << "the right to take rights away (CAP_SETPCAP) is missing";
    }
  }
};

TEST_F(WithoutRealtimeRights, PreferWarnsWithTheRemedyAndServes) {
  test::Process process(
      without_rights({path_of("rtpm-registryd"), "--port", "0", "--realtime", "prefer"}));
  ASSERT_TRUE(process.wait_for_output("rtpm://", kPatience)) << process.errors();
  process.send_signal(SIGTERM);
  const auto end = process.wait(kPatience);
  ASSERT_TRUE(end);
  EXPECT_EQ(end->exit_code, 0);
  // One warning for the scheduling, one for the memory, however many threads there are. Sanitizers
  // make locking memory a no-op, which succeeds, so that there is nothing to warn of.
  std::vector<std::string> words{"SCHED_FIFO", "rtprio"};
  if (!test::kHasSanitizer) words.insert(words.end(), {"memory", "ulimit -l"});
  EXPECT_EQ(test::line_count(end->errors), test::kHasSanitizer ? 1 : 2) << end->errors;
  expect_text(end->errors, words);
}

TEST_F(WithoutRealtimeRights, RequireRefusesWithTheRemedy) {
  const auto end =
      test::run(without_rights({path_of("rtpm-registryd"), "--port", "0", "--realtime", "require"}),
                kPatience);
  ASSERT_TRUE(end);
  expect_one_sentence(*end, 1, {"rtpm-registryd", "Remedy"});
  EXPECT_EQ(end->output, "") << "it must not say that it serves";
}

}  // namespace
}  // namespace rtpm::system_test
