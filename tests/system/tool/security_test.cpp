#include <gtest/gtest.h>
#include <sys/stat.h>

#include <chrono>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include "network_host.hpp"
#include "programs.hpp"
#include "rtpm/test/os.hpp"

// Two machines, as network namespaces: the section "Let another machine in" of docs/security.md,
// word for word, and the message of each wrong step.
namespace rtpm::system_test {
namespace {

constexpr const char* kServerAddress = "192.168.7.4";  // The address in the page.
constexpr const char* kRegistry = "rtpm://192.168.7.4:7420/rtpm/names";

/// The commands of a section of the page, without their comments.
std::vector<std::string> commands_of_page(const std::string& title) {
  std::ifstream file(RTPM_SECURITY_PAGE);
  std::vector<std::string> commands;
  bool is_inside = false;
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with("## ")) is_inside = line == "## " + title;
    if (!is_inside || !line.starts_with("    ")) continue;
    line = line.substr(4, line.find("  #") - 4);
    commands.push_back(line.substr(0, line.find_last_not_of(' ') + 1));
  }
  return commands;
}

/// The text from `before` to `after`, both included; empty if there is none.
std::string part(const std::string& text, const std::string& before, const std::string& after) {
  const std::size_t begin = text.find(before);
  const std::size_t end = begin == text.npos ? begin : text.find(after, begin + before.size());
  return end == text.npos ? "" : text.substr(begin, end + after.size() - begin);
}

class TwoMachines : public testing::Test {
 protected:
  void SetUp() override {
    if (const std::string missing = missing_for_hosts(); !missing.empty()) GTEST_SKIP() << missing;
    std::string name = (std::filesystem::temp_directory_path() / "rtpm-hosts-XXXXXX").string();
    folder_ = ::mkdtemp(name.data());
    server_.emplace("s", folder_ + "/server");
    caller_.emplace("c", folder_ + "/caller");
    caller_->join("eth0", "192.168.7.5/24", *server_, "eth0", std::string(kServerAddress) + "/24");
  }
  void TearDown() override {
    server_.reset();
    caller_.reset();
    if (!folder_.empty()) std::filesystem::remove_all(folder_);
  }

  /// The command as that host's shell gets it, with RTPM's programs in PATH.
  [[nodiscard]] static std::vector<std::string> in_shell(const Host& host,
                                                         const std::string& command) {
    std::vector<std::string> words = host.inside();
    words.insert(words.end(),
                 {"sh", "-c", "PATH=" + std::string(RTPM_PROGRAM_FOLDER) + ":$PATH; " + command});
    return words;
  }
  [[nodiscard]] static test::Process::End run(const Host& host, const std::string& command) {
    return test::run(in_shell(host, command), kPatience).value_or(test::Process::End{});
  }
  [[nodiscard]] test::Process::End at_caller(const std::string& command) const {
    return run(*caller_, command);
  }
  [[nodiscard]] test::Process::End at_server(const std::string& command) const {
    return run(*server_, command);
  }
  /// Lists the registry's names from the caller.
  [[nodiscard]] test::Process::End list() const {
    return at_caller("rtpm list --deadline 2s --registry " + std::string(kRegistry));
  }
  void expect_failure(const test::Process::End& end, const std::vector<std::string>& words) const {
    EXPECT_NE(end.exit_code, 0) << end.output;
    expect_text(end.errors, words);
  }
  [[nodiscard]] std::string key_of(const Host& host) const {
    return part(run(host, "rtpm key show").output, "rtpm25519 ", "=");
  }
  [[nodiscard]] std::string caller_file(const std::string& name) const {
    return folder_ + "/caller/" + name;
  }

  std::string folder_{};
  std::optional<Host> server_, caller_;
};

TEST_F(TwoMachines, AreSetUpAsThePageSays) {
  const std::vector<std::string> commands = commands_of_page("Let another machine in");
  ASSERT_EQ(commands.size(), 6U);
  const auto begin = std::chrono::steady_clock::now();

  const auto made = at_caller(commands[0]);
  EXPECT_EQ(made.exit_code, 0) << made.errors;
  // A user pastes this command on the other machine; it is the page's except for the key.
  const std::string authorize = part(made.output, "rtpm key authorize ", "'**'");
  const auto without_key = [](const std::string& command) {
    return command.substr(0, command.find('\'')) + command.substr(command.find("' --role"));
  };
  ASSERT_NE(authorize, "") << made.output;
  EXPECT_EQ(without_key(authorize), without_key(commands[1]));
  const auto authorized = at_server(authorize);
  EXPECT_EQ(authorized.exit_code, 0) << authorized.errors;

  test::Process demo(in_shell(*server_, "exec " + commands[2] + " --seconds 90"));
  ASSERT_TRUE(demo.wait_for_output("lab/arm0 ", kPatience)) << demo.output() << demo.errors();
  const std::string fingerprint = part(demo.output() + demo.errors(), "fingerprint ", "\n");
  ASSERT_NE(fingerprint, "") << demo.output() << demo.errors();

  // A user compares and confirms; here the option replaces the user.
  const auto learned = at_caller(commands[3] + " --fingerprint " + fingerprint.substr(12, 24));
  EXPECT_EQ(learned.exit_code, 0) << learned.errors;
  const auto called = at_caller(commands[4] + "; " + commands[5]);
  EXPECT_EQ(called.exit_code, 0) << called.errors;
  EXPECT_NE(called.output.find("\"position_m\""), std::string::npos) << called.output;
  std::printf("from `rtpm key new` to the first call: %.1f s\n",
              std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());

  // The command fails without the key.
  std::filesystem::rename(caller_file("key"), caller_file("key.away"));
  expect_failure(at_caller(commands[4] + "; " + commands[5]), {"rtpm key new"});
}

TEST_F(TwoMachines, DoNotServeOtherHostsByAccident) {
  expect_failure(
      at_server("rtpm-registryd --host any"),
      {"/authorized is not there", "rtpm key authorize", "rtpm key learn", "--insecure"});
  test::Process open(
      in_shell(*server_, "exec rtpm-registryd --realtime off --host any --insecure"));
  ASSERT_TRUE(open.wait_for_output("rtpm://", kPatience)) << open.errors();
  EXPECT_TRUE(open.wait_for_errors("serves everybody who reaches", kPatience)) << open.errors();
  EXPECT_EQ(list().exit_code, 0) << list().errors;
  expect_failure(at_caller("rtpm key learn " + std::string(kServerAddress)),
                 {"has no sealed sessions"});
  const auto doctor = at_server("rtpm doctor --quick --json");
  EXPECT_NE(doctor.output.find("open-server"), std::string::npos) << doctor.output;
}

TEST_F(TwoMachines, SayWhatToDoAtEachWrongStep) {
  // One key has a grant, so that the server starts.
  ASSERT_EQ(at_server("rtpm key authorize uid:7 --role observe --on '**'").exit_code, 0);
  test::Process registry(in_shell(*server_, "exec rtpm-registryd --realtime off --host any"));
  ASSERT_TRUE(registry.wait_for_output("rtpm://", kPatience)) << registry.errors();
  const std::string learn = "rtpm key learn " + std::string(kServerAddress);

  expect_failure(list(), {learn});
  expect_failure(at_caller(learn), {"--fingerprint", "rtpm key show"});
  const auto refused = at_caller("echo no | script -qec '" + learn + "' /dev/null");
  EXPECT_NE(refused.output.find("was not confirmed"), std::string::npos) << refused.output;
  EXPECT_FALSE(std::filesystem::exists(caller_file("known_servers")));
  const auto asked = at_caller("echo yes | script -qec '" + learn + "' /dev/null");
  expect_text(asked.output, {"Is it the same there? [yes | no]"});
  EXPECT_EQ(asked.exit_code, 0) << asked.output;
  expect_failure(list(), {"rtpm key new"});
  ASSERT_EQ(at_caller("rtpm key new").exit_code, 0);
  expect_failure(list(), {"rtpm key authorize"});

  ASSERT_EQ(
      at_server("rtpm key authorize '" + key_of(*caller_) + " alice' --role observe --on '**'")
          .exit_code,
      0);
  EXPECT_TRUE(test::await([&] { return list().exit_code == 0; })) << list().errors;
  const auto bound = at_caller("rtpm bind lab/x rtpm://10.0.0.7:1/x --interface lab.X --registry " +
                               std::string(kRegistry));
  expect_failure(bound, {"is not for this caller", "ask its operator"});
  EXPECT_TRUE(registry.wait_for_errors("role=administer on=", kPatience)) << registry.errors();

  ::chmod(caller_file("key").c_str(), 0640);
  expect_failure(list(), {"chmod 600 " + caller_file("key")});
  ::chmod(caller_file("key").c_str(), 0600);

  ASSERT_EQ(at_server("rtpm key revoke alice").exit_code, 0);
  EXPECT_TRUE(test::await([&] { return list().exit_code != 0; }));

  // Another server presents itself at the address.
  registry.send_signal(SIGTERM);
  ASSERT_TRUE(registry.wait(kPatience));
  std::filesystem::remove(folder_ + "/server/key");
  test::Process other(in_shell(*server_, "exec rtpm-registryd --realtime off --host any"));
  ASSERT_TRUE(other.wait_for_output("rtpm://", kPatience)) << other.errors();
  expect_failure(list(), {"another key", "rtpm key forget"});
  expect_failure(at_caller(learn + " --yes"), {"known_servers:1", "rtpm key forget"});
}

}  // namespace
}  // namespace rtpm::system_test
