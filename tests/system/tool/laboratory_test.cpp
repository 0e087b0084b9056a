#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "programs.hpp"
#include "rtpm/test/os.hpp"

// `rtpm up`, `down` and `demo`: real programs that start, die, come back and end together.
namespace rtpm::system_test {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;
using Clock = std::chrono::steady_clock;

constexpr const char* kDaemons = R"(
[laboratory]
environment = {RTPM_REALTIME = "off"}
[[program]]
name = "registry"
run = ["rtpm-registryd", "--port", "0"]
[[program]]
name = "devices"
run = ["rtpm-deviced", "--port", "0", "--devices", "arm0"]
serves = ["lab/arm0"]
restart = "on-failure"
)";

class Up : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(testing::TempDir()) / ("rtpm-up-" + std::to_string(::getpid()));
    fs::remove_all(folder_);
    fs::create_directories(folder_ / "run");
    ::setenv("XDG_RUNTIME_DIR", (folder_ / "run").c_str(), 1);
    // All processes that a test starts inherit this variable, in any session.
    mark_ = "LABORATORY_TEST_MARK=" + folder_.string() + "/" +
            std::to_string(Clock::now().time_since_epoch().count());
    ::setenv("LABORATORY_TEST_MARK", mark_.substr(mark_.find('=') + 1).c_str(), 1);
  }
  void TearDown() override {
    EXPECT_TRUE(test::await([&] { return processes().empty(); })) << "a process is left";
    for (const pid_t process : processes())
      ::kill(process, SIGKILL);
    ::unsetenv("LABORATORY_TEST_MARK");
    ::unsetenv("XDG_RUNTIME_DIR");
    fs::remove_all(folder_);
  }

  std::string file(const std::string& text, const std::string& name = "cell.toml") const {
    std::ofstream(folder_ / name) << text;
    return (folder_ / name).string();
  }
  static test::Process start(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), path_of("rtpm"));
    return test::Process(arguments);
  }
  /// Brings the laboratory up and waits until it is.
  test::Process start_up(const std::string& text, const std::string& name = "cell.toml") const {
    test::Process up = start({"up", file(text, name), "--json"});
    EXPECT_TRUE(up.wait_for_output("\"event\":\"up\"", kPatience)) << up.output() << up.errors();
    return up;
  }
  /// All processes that this test has started and that have not ended, except this one.
  [[nodiscard]] std::vector<pid_t> processes() const {
    std::vector<pid_t> found;
    for (const auto& entry : fs::directory_iterator("/proc")) {
      const std::string name = entry.path().filename();
      if (name.find_first_not_of("0123456789") != std::string::npos) continue;
      std::ifstream environment(entry.path() / "environ");
      const std::string text{std::istreambuf_iterator<char>(environment),
                             std::istreambuf_iterator<char>()};
      const pid_t process = std::stoi(name);
      if (text.find(mark_) != std::string::npos && process != ::getpid()) found.push_back(process);
    }
    return found;
  }
  static std::vector<Json> events_in(const std::string& output) {
    std::vector<Json> events;
    std::istringstream lines(output);
    for (std::string line; std::getline(lines, line);)
      events.push_back(Json::parse(line, nullptr, false));
    return events;
  }
  /// The changes to one of `states`, in order, such as "registry serving".
  static std::vector<std::string> states_in(const std::string& output,
                                            const std::vector<std::string>& states) {
    std::vector<std::string> found;
    for (const Json& event : events_in(output)) {
      if (!event.is_object() || event["event"] != "state") continue;
      const std::string state = event["state"];
      if (std::ranges::find(states, state) != states.end())
        found.push_back(event["program"].get<std::string>() + " " + state);
    }
    return found;
  }
  /// The process of the program's latest start.
  static pid_t process_of(const std::string& output, const std::string& program) {
    pid_t process = 0;
    for (const Json& event : events_in(output)) {
      if (event.is_object() && event.value("program", "") == program && event.contains("process"))
        process = event["process"];
    }
    return process;
  }
  /// Runs `rtpm up` with a file of these programs, each a shell script, until it has ended.
  [[nodiscard]] test::Process::End run_up(const std::string& text) const {
    return run_program("rtpm", {"up", file(text), "--json"});
  }
  static std::string shell(const std::string& name, const std::string& script,
                           const std::string& keys = {}) {
    return "[[program]]\nname = \"" + name + "\"\nrun = [\"sh\", \"-c\", '''" + script + "''']\n" +
           keys;
  }
  static pid_t child_of(pid_t parent) {
    std::ifstream children("/proc/" + std::to_string(parent) + "/task/" + std::to_string(parent) +
                           "/children");
    pid_t child = 0;
    children >> child;
    return child;
  }
  /// The number in the laboratory's pid file.
  [[nodiscard]] pid_t guard() const {
    std::ifstream file(folder_ / "run" / "rtpm" / "cell.pid");
    pid_t process = 0;
    file >> process;
    return process;
  }

  fs::path folder_;
  std::string mark_;
};

TEST_F(Up, StartsInOrderAndEndsInReverseAtCtrlC) {
  test::Process up = start_up(kDaemons);
  up.send_signal(SIGINT);
  const auto end = up.wait(kPatience);
  ASSERT_TRUE(end);
  EXPECT_EQ(end->exit_code, 0) << end->output << end->errors;
  EXPECT_EQ(states_in(end->output, {"serving", "ended"}),
            (std::vector<std::string>{"registry serving", "devices serving", "devices ended",
                                      "registry ended"}))
      << end->output;
  EXPECT_EQ(end->errors, "");
}

TEST_F(Up, PrintsLinesWhereThereIsNoTerminal) {
  test::Process up = start({"up", file(kDaemons)});
  ASSERT_TRUE(up.wait_for_output("cell is up", kPatience)) << up.output() << up.errors();
  up.send_signal(SIGTERM);
  const auto end = up.wait(kPatience);
  ASSERT_TRUE(end);
  EXPECT_EQ(end->exit_code, 0) << end->errors;
  expect_text(end->output, {"registry | registry at rtpm://", "devices: serving at rtpm://",
                            "cell ends: SIGTERM", "registry: ended"});
  EXPECT_EQ(end->output.find('\x1b'), std::string::npos);
}

TEST_F(Up, RestartsAProgramThatWasKilled) {
  test::Process up = start_up(kDaemons);
  ASSERT_EQ(::kill(process_of(up.output(), "devices"), SIGKILL), 0);
  ASSERT_TRUE(up.wait_for_output("\"state\":\"pausing\"", kPatience));
  ASSERT_TRUE(up.wait_for_output("\"restarts\":1", kPatience));
  ASSERT_TRUE(test::await([&] {
    static_cast<void>(up.wait_for_output("nothing prints this", std::chrono::milliseconds{10}));
    return states_in(up.output(), {"serving"}).size() == 3;
  })) << up.output();
  up.send_signal(SIGTERM);
  const auto end = up.wait(kPatience);
  ASSERT_TRUE(end);
  EXPECT_EQ(end->exit_code, 0) << end->output << end->errors;
}

TEST_F(Up, FailsWhenTheLimitOfRestartsIsReached) {
  const auto end = run_program("rtpm", {"up", file(R"(
[[program]]
name = "broken"
run = ["sh", "-c", "echo why it fails; exit 3"]
restart = "on-failure"
)")});
  expect_one_sentence(end, 1, {"'cell' failed", "broken", "exit code 3", "5 restarts within 1min"});
  EXPECT_NE(end.output.find("broken | why it fails"), std::string::npos) << end.output;
}

TEST_F(Up, WaitsForNamesAtTheRegistry) {
  // The one-shot program finds the name through the registry in its environment.
  const auto end = run_program("rtpm", {"up", file(std::string(kDaemons) + R"(
[[program]]
name = "look"
run = ["rtpm", "list"]
one_shot = true
main = true
)")});
  EXPECT_EQ(end.exit_code, 0) << end.errors;
  EXPECT_NE(end.output.find("look | lab/arm0"), std::string::npos) << end.output;
}

TEST_F(Up, FailsWithAProgramThatDoesNotServeInTime) {
  const auto end = run_program("rtpm", {"up", file(std::string(kDaemons) + R"(
[[program]]
name = "late"
run = ["sleep", "1000"]
serves = ["lab/late"]
ready_deadline = "300ms"
)"),
                                        "--json"});
  expect_one_sentence(end, 1, {"late: it did not serve within 300ms"});
  EXPECT_EQ(states_in(end.output, {"failed", "ended"}),
            (std::vector<std::string>{"late failed", "devices ended", "registry ended"}));
}

/// A program with a grandchild in a session of its own, and one that ignores SIGTERM.
constexpr const char* kStubborn = R"(
[[program]]
name = "stubborn"
run = ["sh", "-c", """
  trap '' TERM; setsid sleep 1000 & sleep 1001 & echo ready; while :; do wait; done"""]
ready_line = "ready"
stop_patience = "200ms"
)";

TEST_F(Up, LeavesNothingWhenItIsKilled) {
  test::Process up = start_up(std::string(kDaemons) + kStubborn);
  EXPECT_GE(processes().size(), 6u);
  ASSERT_EQ(::kill(guard(), SIGKILL), 0);
  EXPECT_TRUE(test::await([&] { return processes().empty(); }));
}

TEST_F(Up, LeavesNothingWhenItsSupervisorIsKilled) {
  test::Process up = start_up(std::string(kDaemons) + kStubborn);
  const pid_t supervisor = child_of(guard());
  ASSERT_GT(supervisor, 0);
  ASSERT_EQ(::kill(supervisor, SIGKILL), 0);
  const auto end = up.wait(kPatience);
  ASSERT_TRUE(end);
  expect_one_sentence(*end, 1, {"its supervisor was killed"});
  EXPECT_TRUE(processes().empty());
}

TEST_F(Up, KillsProgramsThatDoNotEnd) {
  test::Process up = start_up(kStubborn);
  up.send_signal(SIGTERM);
  const auto end = up.wait(kPatience);
  ASSERT_TRUE(end);
  expect_one_sentence(*end, 1, {"stubborn", "within 200ms of SIGTERM", "killed"});
}

TEST_F(Up, KillsAllAtASecondRequest) {
  std::string text = kStubborn;
  text.replace(text.find("200ms"), 5, "10min");
  test::Process up = start_up(shell("first", "exec sleep 1000") + text);
  up.send_signal(SIGTERM);
  ASSERT_TRUE(up.wait_for_output("\"state\":\"stopping\"", kPatience));
  std::optional<test::Process::End> end;
  // A second signal within half a second does not count.
  EXPECT_TRUE(test::await([&] {
    up.send_signal(SIGTERM);
    end = up.wait(std::chrono::milliseconds{100});
    return end.has_value();
  }));
  ASSERT_TRUE(end);
  EXPECT_NE(end->output.find("\"note\":\"killed\""), std::string::npos) << end->output;
  EXPECT_EQ(end->exit_code, 0) << end->errors;
  EXPECT_EQ(states_in(end->output, {"failed"}), std::vector<std::string>()) << end->output;
}

TEST_F(Up, RestartsUsersOfAUrlThatHasChanged) {
  const std::string url = "echo rtpm://127.0.0.1:$$$$/a; trap \"exit 0\" TERM; sleep 1000 & wait";
  test::Process up =
      start_up(shell("a", url, "restart = \"on-failure\"\n") +
               shell("b", "echo got ${a.url}; exec sleep 1000", "restart = \"on-failure\"\n"));
  const pid_t first = process_of(up.output(), "a");
  const std::string got = "got rtpm://127.0.0.1:" + std::to_string(first);
  ASSERT_TRUE(up.wait_for_output(got, kPatience)) << up.output();
  ASSERT_EQ(::kill(-first, SIGKILL), 0);
  ASSERT_TRUE(up.wait_for_output("a has another URL", kPatience)) << up.output();
  EXPECT_TRUE(test::await([&] {
    static_cast<void>(up.wait_for_output("nothing prints this", std::chrono::milliseconds{10}));
    const pid_t second = process_of(up.output(), "a");
    return up.output().find("got rtpm://127.0.0.1:" + std::to_string(second)) != std::string::npos;
  })) << up.output();
  up.send_signal(SIGTERM);
  const auto end = up.wait(kPatience);
  ASSERT_TRUE(end);
  EXPECT_EQ(end->exit_code, 0) << end->output << end->errors;
}

TEST_F(Up, StartsAProgramWhenTheOneBeforeHasPrintedItsLine) {
  const auto end = run_up(
      shell("a", "echo almost; echo ready >&2; exec sleep 1000", "ready_line = \"ready\"\n") +
      shell("b", "true", "main = true\n"));
  EXPECT_EQ(end.exit_code, 0) << end.errors;
  EXPECT_EQ(states_in(end.output, {"starting", "serving"}),
            (std::vector<std::string>{"a starting", "a serving", "b starting", "b serving"}));
}

TEST_F(Up, EndsWhenAllMainProgramsHaveEnded) {
  const auto end = run_up(shell("a", "exec sleep 1000") + shell("b", "true", "main = true\n") +
                          shell("c", "true", "main = true\n"));
  EXPECT_EQ(end.exit_code, 0) << end.errors;
  EXPECT_EQ(states_in(end.output, {"ended"}), std::vector<std::string>{"a ended"}) << end.output;
}

TEST_F(Up, GoesOnWithoutAProgramThatFailsLaterUnlessItIsNeeded) {
  const std::string task = shell("a", "kill -9 $$$$", "after = \"b\"\n");
  const std::string other = shell("b", "exec sleep 0.3", "after = []\nmain = true\n");
  const auto end = run_up(task + other);
  expect_one_sentence(end, 1, {"a: SIGKILL"});
  EXPECT_EQ(states_in(end.output, {"done", "ended"}), std::vector<std::string>{"b done"});
  const auto needed = run_up(task + "needed = true\n" + other);
  expect_one_sentence(needed, 1, {"a: SIGKILL"});
  EXPECT_EQ(states_in(needed.output, {"done", "ended"}), std::vector<std::string>{"b ended"});
}

TEST_F(Up, FailsWithAProgramThatEndsBeforeItServes) {
  expect_one_sentence(run_up(shell("a", "true", "serves = \"line\"\n")), 1,
                      {"a: it ended before it served"});
  expect_one_sentence(run_up(shell("a", "exit 3", "one_shot = true\n") + shell("b", "true")), 1,
                      {"a: exit code 3"});
}

TEST_F(Up, ChecksTheExitOfAProgramThatItStops) {
  for (const auto& [script, exit_code] :
       {std::pair("exit 0", 0), {"exit 143", 0}, {"exit 3", 1}, {"kill -11 $$$$", 1}}) {
    const auto end = run_up(
        shell("a", std::string("trap \"") + script + "\" TERM; echo ready; sleep 1000 & wait",
              "ready_line = \"ready\"\n") +
        shell("b", "true", "main = true\n"));
    EXPECT_EQ(end.exit_code, exit_code) << script << end.output << end.errors;
  }
}

TEST_F(Up, PrintsASystemdUnit) {
  const auto end = run_program("rtpm", {"up", file("[variables]\nx = \"1\"\n" + shell("a", "true")),
                                        "--systemd", "--set", "x=100%"});
  expect_one_sentence(end, 0,
                      {"~/.config/systemd/user/rtpm-cell.service",
                       "systemctl --user enable --now rtpm-cell.service"});
  expect_text(end.output,
              {"ExecStart=" + path_of("rtpm") + " up \"" + (folder_ / "cell.toml").string() + "\"",
               std::string(" --set \"x=100%%\"\n"), std::string("Restart=on-failure\n"),
               std::string("KillMode=mixed\n"), std::string("TimeoutStopSec=7\n")});
}

TEST_F(Up, RefusesAStateFolderThatOthersMayEnter) {
  fs::create_directories(folder_ / "run" / "rtpm");
  fs::permissions(folder_ / "run" / "rtpm", fs::perms::all);
  const auto end = run_program("rtpm", {"up", file(shell("a", "true"))});
  expect_one_sentence(end, 1, {"is not safe", "chmod 700"});
  fs::remove(folder_ / "run" / "rtpm");
  fs::create_directory_symlink(folder_, folder_ / "run" / "rtpm");
  expect_one_sentence(run_program("rtpm", {"down"}), 1, {"is not safe"});
}

TEST_F(Up, IsRefusedTwiceAndEndedFromElsewhere) {
  test::Process up = start_up(kDaemons);
  expect_one_sentence(run_program("rtpm", {"up", file(kDaemons)}), 1,
                      {"'cell' is already up", "`rtpm down cell`"});
  const auto down = run_program("rtpm", {"down", "cell"});
  EXPECT_EQ(down.exit_code, 0) << down.errors;
  EXPECT_EQ(down.output, "cell has ended\n");
  const auto end = up.wait(kPatience);
  ASSERT_TRUE(end);
  EXPECT_EQ(end->exit_code, 0);
}

TEST_F(Up, LeavesTheTerminalWhenEverythingServes) {
  const auto end = run_program("rtpm", {"up", file(kDaemons), "--detach"});
  ASSERT_EQ(end.exit_code, 0) << end.errors;
  EXPECT_NE(end.output.find("`rtpm down cell` ends it"), std::string::npos) << end.output;
  const auto down = run_program("rtpm", {"down", "--json"});
  EXPECT_EQ(down.exit_code, 0) << down.errors;
  EXPECT_EQ(Json::parse(down.output, nullptr, false)["ended"], true) << down.output;
  EXPECT_TRUE(test::await([&] { return processes().empty(); }));
  std::ifstream log(folder_ / "run" / "rtpm" / "cell.log");
  const std::string text{std::istreambuf_iterator<char>(log), std::istreambuf_iterator<char>()};
  EXPECT_NE(text.find("devices: ended"), std::string::npos) << text;
}

TEST_F(Up, ReportsABackgroundFailureInTheForeground) {
  const auto end = run_program(
      "rtpm", {"up", file("[[program]]\nname = \"a\"\nrun = [\"false\"]\nserves = \"line\"\n"),
               "--detach"});
  expect_one_sentence(end, 1, {"a: exit code 1"});
}

TEST_F(Up, ChecksItsFile) {
  const auto text = run_program("rtpm", {"up", file(kDaemons), "--check"});
  EXPECT_EQ(text.exit_code, 0) << text.errors;
  EXPECT_NE(text.output.find("devices   registry"), std::string::npos) << text.output;
  const auto json = run_program("rtpm", {"up", file(kDaemons), "--check", "--json"});
  const Json plan = Json::parse(json.output, nullptr, false);
  EXPECT_EQ(plan["programs"][1]["after"], Json{"registry"}) << json.output;
  const auto wrong = file("[[program]]\nname = \"a\"\nrun = [\"rtpm-devicd\"]\nrestrat = 1\n");
  const auto end = run_program("rtpm", {"up", wrong, "--check"});
  EXPECT_EQ(end.exit_code, 2);
  EXPECT_EQ(test::line_count(end.errors), 2) << end.errors;
  expect_text(end.errors,
              {wrong + ":3:8: ", wrong + ":4:1: ", std::string("there is no program 'rtpm-devicd'"),
               std::string("did you mean 'restart'")});
  expect_one_sentence(run_program("rtpm", {"up", "/nowhere.toml"}), 2,
                      {"/nowhere.toml", "No such"});
  expect_one_sentence(run_program("rtpm", {"up", file(kDaemons), "--set", "x"}), 2, {"NAME=VALUE"});
}

TEST_F(Up, ReportsOutputInJsonWithoutControlCharacters) {
  const std::string text = "[[program]]\nname = \"a\"\nrun = [\"printf\", '\\033[2Jx\\n']\n";
  const auto json = run_program("rtpm", {"up", file(text), "--json"});
  expect_text(json.output, {R"("stream":"stdout","line":"\u001b[2Jx")"});
  const auto plain = run_program("rtpm", {"up", file(text)});
  EXPECT_NE(plain.output.find("a | \\x1b[2Jx\n"), std::string::npos) << plain.output;
}

TEST_F(Up, RefusesDownOfNothing) {
  expect_one_sentence(run_program("rtpm", {"down"}), 1, {"no laboratory", "is up on this host"});
  expect_one_sentence(run_program("rtpm", {"down", "cell"}), 1, {"no laboratory 'cell'"});
}

TEST_F(Up, NeedsANameForDownOfOneAmongSeveral) {
  const std::string text = "[[program]]\nname = \"a\"\nrun = [\"sleep\", \"1000\"]\n";
  test::Process first = start_up(text, "first.toml");
  test::Process second = start_up(text, "second.toml");
  const auto list = run_program("rtpm", {"down"});
  expect_one_sentence(list, 2, {"several", "rtpm down first"});
  expect_text(list.errors, {"first.toml", "second.toml"});
  expect_one_sentence(run_program("rtpm", {"down", "secnd"}), 1, {"did you mean 'second'"});
  EXPECT_EQ(run_program("rtpm", {"down", "second"}).exit_code, 0);
  EXPECT_EQ(run_program("rtpm", {"down"}).output, "first has ended\n");
}

TEST_F(Up, ShowsTheDemo) {
  // Variables of the tool's own options are for the tool, not for the demo's programs.
  const auto end =
      test::run({"env", "RTPM_REALTIME=off", "RTPM_DEADLINE=5s", "RTPM_PORT=1", "RTPM_SECONDS=0",
                 "RTPM_RATE=7", path_of("rtpm"), "demo", "--seconds", "2"},
                kPatience);
  ASSERT_TRUE(end);
  EXPECT_EQ(end->exit_code, 0) << end->output << end->errors;
  expect_text(end->output,
              {"lab/arm0", "lab/gaze0", "lab/biometric0", "lab/knob0", "samples shown",
               "latency in us", "one cycle of two calls", "console | serving http://127.0.0.1:"});
  EXPECT_LT(end->output.find("samples shown"), end->output.find("latency in us"));
}

TEST_F(Up, EndsTheDemoInOrderAtCtrlC) {
  test::Process demo({"env", "RTPM_REALTIME=off", path_of("rtpm"), "demo", "--seconds", "0"});
  ASSERT_TRUE(demo.wait_for_output("lab/knob0", kPatience)) << demo.errors();
  demo.send_signal(SIGINT);
  const auto end = demo.wait(kPatience);
  ASSERT_TRUE(end) << "it goes on";
  EXPECT_EQ(end->exit_code, 0) << end->output << end->errors;
  EXPECT_NE(end->output.find("one cycle of two calls"), std::string::npos) << end->output;
}

// A bookmark of the page works again.
TEST_F(Up, KeepsTheUrlOfTheDemosConsole) {
  ::setenv("XDG_STATE_HOME", (folder_ / "state").c_str(), 1);
  std::vector<std::string> tokens;
  std::vector<std::string> urls;
  for (int i = 0; i < 2; ++i) {
    const auto end = test::run(
        {"env", "RTPM_REALTIME=off", path_of("rtpm"), "demo", "--seconds", "1"}, kPatience);
    ASSERT_TRUE(end);
    ASSERT_EQ(end->exit_code, 0) << end->output << end->errors;
    std::ifstream token(folder_ / "state" / "rtpm" / "demo-console.token");
    std::getline(token, tokens.emplace_back());
    const std::size_t begin = end->output.find("http://127.0.0.1:");
    ASSERT_NE(begin, std::string::npos) << end->output;
    urls.push_back(end->output.substr(begin, end->output.find('/', begin + 7) - begin));
  }
  ::unsetenv("XDG_STATE_HOME");
  EXPECT_GE(tokens[0].size(), 16u);
  EXPECT_EQ(tokens[0], tokens[1]);
  EXPECT_EQ(urls[0], urls[1]);
  const auto permissions =
      fs::status(folder_ / "state" / "rtpm" / "demo-console.token").permissions();
  EXPECT_EQ(permissions, fs::perms::owner_read | fs::perms::owner_write);
}

TEST_F(Up, TakesARecordedHandForTheDemo) {
  const auto hand = folder_ / "hand.csv";
  std::ofstream(hand) << "t_s,x_m,y_m,z_m\n0,0,0,0\n1,0,0,0.01\n";
  const auto end = test::run({"env", "RTPM_REALTIME=off", path_of("rtpm"), "demo", "--seconds", "1",
                              "--hand", hand.string(), "--json"},
                             kPatience);
  ASSERT_TRUE(end);
  EXPECT_EQ(end->exit_code, 0) << end->output << end->errors;
  for (const Json& event : events_in(end->output))
    EXPECT_TRUE(event.is_object()) << end->output;
  expect_one_sentence(run_program("rtpm", {"demo", "--hand", "/nowhere.csv"}), 2, {"/nowhere.csv"});
}

}  // namespace
}  // namespace rtpm::system_test
