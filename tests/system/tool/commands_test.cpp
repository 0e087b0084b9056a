#include <gtest/gtest.h>
#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "../../unit/recording/recorded.hpp"
#include "programs.hpp"
#include "rtpm/test/hello_responder.hpp"
#include "shell_help.hpp"

// Every command of `rtpm`, each run for its text, its JSON and a failure. A command that is not in
// the table fails the test.
namespace rtpm::system_test {
namespace {

using Json = nlohmann::json;
using Arguments = std::vector<std::string>;

/// A command and three ways to run it.
struct Case {
  std::string path;     ///< "config list".
  std::string run;      ///< The words behind the path that succeed.
  std::string words;    ///< Part of its text.
  std::string failing;  ///< The words behind the path that fail.
  int exit_code = 1;    ///< The exit code after `failing`.
  std::string why;      ///< Part of its error.
};

/// A device or a server did not run in time; the cycles that follow a stop are not over; a lease
/// ended just now.
constexpr std::array kEarly{"had no time for it", "within the deadline", "has no flight record",
                            "has changed a moment ago"};

/// A key of 32 zero bytes.
const std::string kOtherKey = "rtpm25519 AAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAA=";
const std::string kAlice = "# people\n" + kOtherKey + " name=alice role=command on=lab/**\n";

constexpr const char* kSampled = "--filter type(rtpm.device.Sampled)";

/// The cases, in an order that lets one command prepare for the next. RUN is a whole recording,
/// DEVICES one of a device, BROKEN the first half of RUN, LABORATORY a file for `rtpm up`, NEW1 and
/// NONE paths without a file, KEY a key, SERVER a server that shows its key, OTHERS known servers
/// with another key for it, GRANTS lets alice in.
std::vector<Case> cases() {
  const std::string sampled = kSampled;
  return {
      {"list", "", "lab/arm0", "lab/arm1", 3, "most like it: lab/arm0"},
      {"info", "lab/arm0", "rtpm info lab/arm0 --schema", "lab/arm1", 3, "most like it: lab/arm0"},
      {"stubs", "lab/arm0 -o NEW1", "arm0_rtpm.pyi", "lab/arm1", 3, "most like it: lab/arm0"},
      {"find", "lab/*", "lab/arm0", "x*", 1, "none of the"},
      {"watch", "lab --for 10ms", "bound  lab/arm0", "--for x", 2, "no duration"},
      {"bind", "lab/cam rtpm://127.0.0.1:1/x --interface lab.X --replace", "lab/cam is bound to",
       "lab/cam nowhere --interface lab.X", 1, "URL"},
      {"resolve", "lab/arm0", "rtpm://127.0.0.1:", "lab/arm1", 3, "lab/arm1"},
      {"call", "lab/arm0 read", "\"position_m\"", "lab/arm0 reed", 1, "did you mean 'read'?"},
      {"ping", "lab/arm0 --count 2 --interval 1ms", "2 pings, 0 lost", "lab/arm", 3, "lab/arm0"},
      {"echo", sampled + " --count 1", "rtpm.device.Sampled", "--hub lab/none", 3, "lab/none"},
      {"pub", "rtpm.device.ButtonChanged {cycle:1,button:2,is_pressed:true}", "1 event was pushed",
       "rtpm.device.ButtonChanged {cycle:1,button:256,is_pressed:true}", 1,
       "in the field 'button'"},
      {"mark", "pause", "marked: pause", "pause --hub lab/none", 3, "lab/none"},
      {"consumers", "", "CONSUMER", "--hub lab/none", 3, "lab/none"},
      {"incidents", "--file NONE", "no incident so far", "acknowledge 7 --as Anna --file NONE", 1,
       "no incident 7"},
      {"hz", sampled + " --for 200ms", "JITTER RMS", "--hub rtpm/event", 3, "rtpm/events"},
      {"record", "NEW1 --for 200ms", " messages, ", "RUN --for 10ms", 1, "exists"},
      {"session", "--pattern NEW1 --for 200ms", " messages, ", "--pattern {x} --for 10ms", 2,
       "{participant}"},
      {"play", "DEVICES --speed 100 --folder again --hub none", ": played ", "RUN", 1,
       "no device or event to play"},
      {"bag info", "RUN", "100 messages in ", "NONE", 1, "No such file"},
      {"bag check", "RUN", "is whole", "NONE", 1, "No such file"},
      {"bag recover", "BROKEN -o NEW1", "messages", "BROKEN -o RUN", 1, "exists already"},
      {"bag cut", "RUN -o NEW1 --to 10ms", "messages", "RUN -o NEW1 --topics x", 1, "no topic 'x'"},
      {"bag export", "DEVICES NEW1 --csv", " messages in ", "NONE NEW1 --csv", 1, "No such file"},
      {"key new", "--file NEW1 --comment alice@lab", "--role command", "--file KEY", 1,
       "there is one already"},
      {"key show", "KEY", "fingerprint ", "NONE", 1, "rtpm key new"},
      {"key learn", "SERVER --yes --known-servers NEW1", "sealed sessions only",
       "SERVER --known-servers OTHERS", 1, "has fingerprint"},
      {"key forget", "SERVER --known-servers OTHERS", "removed line 1", "10.0.0.7", 1,
       "rtpm key list"},
      {"key authorize", "uid:7 --role observe --on lab/* --file NEW1", "within a second",
       "bob --role observe --on ** --file NEW1", 1, "not 'bob'"},
      {"key revoke", "alice --file GRANTS", "removed line 2", "bob --file GRANTS", 1, "for 'bob'"},
      {"key list", "--key KEY --known-servers OTHERS --authorized GRANTS", "command on=lab/**",
       "all", 2, "unexpected argument 'all'"},
      {"up", "LABORATORY --check", "is right", "NONE", 2, "can't be read"},
      {"demo", "--seconds 1", "samples shown", "--seconds -1", 2, "--seconds"},
      {"ros2", "--seconds 1", "bridge", "--seconds -1", 2, "--seconds"},
      {"config list", "lab/arm0", "safety.ramp_s", "lab/arm", 3, "most like it: lab/arm0"},
      {"config get", "lab/arm0 safety.ramp_s", "safety.ramp_s=0.02", "lab/arm0 safety.rampe_s", 1,
       "did you mean 'safety.ramp_s'?"},
      {"config set", "lab/arm0 safety.ramp_s=0.01", "safety.ramp_s=0.01",
       "lab/arm0 safety.ramp_s=9", 1, "out of range"},
      {"config save", "lab/arm0", "saved", "lab/arm1", 3, "lab/arm1"},
      {"config reset", "lab/arm0 safety.ramp_s", "safety.ramp_s=0.02", "lab/arm0 x", 1, "'x'"},
      {"config calibrate", "lab/arm0", "encoder_offset", "lab/arm0 encoder_ofset", 1,
       "did you mean 'encoder_offset'?"},
      {"take-over", "lab/arm0 --for 10ms", "was taken over", "lab/arm1", 3,
       "most like it: lab/arm0"},
      {"estop", "lab/arm0", "is stopped", "lab/arm1", 3, "most like it: lab/arm0"},
      {"flight-record", "lab/arm0", "# fault 1: emergency stop", "lab/arm1", 3,
       "most like it: lab/arm0"},
      {"lanes", "", "PROCESS", "always", 2, "unexpected argument 'always'"},
      {"clocks", "lab/arm0 --for 10ms", "rtpm://127.0.0.1:", "lab/arm1", 3,
       "most like it: lab/arm0"},
      {"top", "--once --interval 100ms", "CALLS/S", "--interval 1ms", 2, "100ms to 10min"},
      {"doctor", "--quick", "good", "--dry-run", 2, "--fix"},
      {"version", "lab/arm0", "rtpm ", "lab/arm1", 3, "most like it: lab/arm0"},
      {"completion", "bash", "_rtpm()", "tcsh", 2, "bash,zsh,fish"},
      {"manual", "", ".TH RTPM 1", "page", 2, "unexpected argument 'page'"},
  };
}

Arguments words_of(const std::string& text) {
  std::istringstream stream(text);
  Arguments words;
  for (std::string word; stream >> word;)
    words.push_back(word);
  return words;
}

/// Whether the build has the programs that the command starts.
bool is_built(const Case& c) {
  return c.path != "ros2" || std::filesystem::exists(path_of("rtpm-ros2"));
}

class Commands : public WithRegistry {
 protected:
  void SetUp() override {
    WithRegistry::SetUp();
    ::setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST", 1);
    device_ =
        start_server("rtpm-deviced", {"--serve-events", "--settings", folder_.fresh("settings")});
    ASSERT_TRUE(device_);
    auto writer = recording::FileWriter::create(whole_, {.chunk_byte_max = 400});
    ASSERT_TRUE(writer);
    recording::write_messages(**writer, 100);
    ASSERT_TRUE((*writer)->close());
    ASSERT_EQ(run({"record", devices_, "--for", "200ms", "--registry", registry_->url}).exit_code,
              0);
    const std::string content = recording::content_of(whole_);
    recording::put_content(broken_, std::string_view(content).substr(0, content.size() / 2));
    ASSERT_EQ(run({"key", "new", "--file", key_}).exit_code, 0);
    recording::put_content(laboratory_,
                           "[laboratory]\nname = \"cell\"\n[[program]]\nname = \"registry\"\n"
                           "run = [\"rtpm-registryd\"]\n");
  }

  /// Returns the arguments with the names of the table's files replaced.
  [[nodiscard]] Arguments arguments_of(const std::string& path, const std::string& rest) const {
    Arguments arguments = words_of(path + " " + rest);
    for (std::string& word : arguments) {
      if (word == "RUN") word = whole_;
      if (word == "DEVICES") word = devices_;
      if (word == "BROKEN") word = broken_;
      if (word == "LABORATORY") word = laboratory_;
      if (word == "KEY") word = key_;
      if (word == "SERVER") word = server_place();
      if (word == "OTHERS") word = file_of("others", server_place() + " " + kOtherKey + "\n");
      if (word == "GRANTS") word = file_of("grants", kAlice);
      if (word == "NONE") word = folder_.fresh("none");
      if (word == "NEW1") word = folder_.fresh("new");
    }
    arguments.insert(arguments.end(), {"--registry", registry_->url});
    return arguments;
  }
  [[nodiscard]] std::string server_place() const {
    return "127.0.0.1:" + std::to_string(server_.port());
  }
  /// A new file with this content.
  [[nodiscard]] std::string file_of(const std::string& name, const std::string& content) const {
    std::string path = folder_.fresh(name);
    recording::put_content(path, content);
    ::chmod(path.c_str(), 0600);
    return path;
  }
  /// Repeats the command while the machine is too busy for it, or it comes too early.
  [[nodiscard]] static test::Process::End run(const Arguments& arguments) {
    test::Process::End end;
    for (int i = 0; i < 300; ++i) {
      end = run_program("rtpm", arguments);
      if (!is_early(end)) break;
    }
    return end;
  }
  [[nodiscard]] static bool is_early(const test::Process::End& end) {
    return std::ranges::any_of(
        kEarly, [&](const char* words) { return end.errors.find(words) != std::string::npos; });
  }

  void expect_output(const Case& c) const {
    const auto end = run(arguments_of(c.path, c.run));
    EXPECT_NE(end.output.find(c.words), std::string::npos) << end.output << end.errors;
    EXPECT_EQ(end.output.find('\x1b'), std::string::npos) << "nobody looks";
    expect_code(c, end);
  }
  void expect_json(const Case& c) const {
    const auto end = run(arguments_of(c.path, c.run + " --json"));
    EXPECT_NE(end.output, "");
    std::istringstream lines(end.output);
    for (std::string line; std::getline(lines, line);)
      EXPECT_FALSE(Json::parse(line, nullptr, false).is_discarded()) << line;
    expect_code(c, end);
  }
  /// The doctor's exit code depends on the machine.
  static void expect_code(const Case& c, const test::Process::End& end) {
    if (c.path == "doctor") {
      EXPECT_LE(end.exit_code, 1) << end.errors;
    } else {
      EXPECT_EQ(end.exit_code, 0) << end.errors;
    }
  }
  void expect_failure(const Case& c) const {
    expect_one_sentence(run(arguments_of(c.path, c.failing)), c.exit_code, {c.why});
    const auto end = run(arguments_of(c.path, c.failing + " --json"));
    const Json error = Json::parse(end.errors, nullptr, false);
    ASSERT_FALSE(error.is_discarded()) << end.errors;
    EXPECT_EQ(error["error"]["exit_code"], c.exit_code) << end.errors;
    EXPECT_NE(error["error"]["what"], "") << end.errors;
    EXPECT_EQ(end.exit_code, c.exit_code);
  }

  recording::Folder folder_;
  std::string whole_ = folder_.fresh("whole");
  std::string devices_ = folder_.fresh("devices");
  std::string broken_ = folder_.fresh("broken");
  std::string laboratory_ = folder_.fresh("laboratory");
  std::string key_ = folder_.fresh("key");
  test::HelloResponder server_{[](ConstBytes hello) { return test::sealed_cookie(hello, 7, 0); }};
  std::optional<Daemon> device_{};
};

TEST(CommandTable, HasEveryCommandOfTheProgramOnce) {
  std::set<std::string> tested;
  for (const Case& c : cases())
    EXPECT_TRUE(tested.insert(c.path).second) << c.path << " is there twice";
  std::set<std::string> known;
  for (const std::string& command : commands_below("")) {
    if (commands_below(command).empty()) known.insert(command);
  }
  // These end something that exists only once: see laboratory_test.cpp and objects_test.cpp.
  for (const char* ending : {"down", "unbind"})
    EXPECT_EQ(known.erase(ending), 1u) << ending;
  EXPECT_EQ(tested, known) << "the table above has a row for each command";
}

TEST_F(Commands, HaveTextJsonAndAFailure) {
  for (const Case& c : cases()) {
    if (!is_built(c)) continue;
    SCOPED_TRACE("rtpm " + c.path);
    expect_output(c);
    expect_json(c);
    expect_failure(c);
  }
}

TEST_F(Commands, FailWhereTheirOutputCantBeWritten) {
  for (const Case& c : cases()) {
    if (!is_built(c)) continue;
    SCOPED_TRACE("rtpm " + c.path);
    Arguments command{"sh", "-c", "exec \"$0\" \"$@\" >/dev/full", path_of("rtpm")};
    const Arguments arguments = arguments_of(c.path, c.run);
    command.insert(command.end(), arguments.begin(), arguments.end());
    test::Process::End end;
    for (int i = 0; i < 300; ++i) {
      const auto ended = test::run(command, kPatience);
      ASSERT_TRUE(ended) << "it does not end";
      end = *ended;
      if (!is_early(end)) break;
    }
    EXPECT_EQ(end.exit_code, 1) << end.errors;
    expect_text(end.errors, {"rtpm: standard output can't be written: No space left on device"});
  }
}

TEST_F(Commands, RefuseInvalidNumbers) {
  for (const char* command :
       {"ping lab/arm0 --count -1", "ping lab/arm0 --count 1.5", "echo --count -1",
        "echo --every 0", "pub lab.Touched {} --count -1", "pub lab.Touched {} --source -1",
        "pub lab.Touched {} --source 99999999999", "call lab/arm0 read --priority 32768",
        "call lab/arm0 read --priority -1", "call lab/arm0 read --deadline 0s",
        "config set lab/arm0 a=1 --revision -1", "mark --begin", "mark --trial 0",
        "mark x --trial 3 --seed -1"}) {
    expect_one_sentence(run(arguments_of(command, "")), 2, {"--"});
  }
}

TEST_F(Commands, PointAtMistakesInJson) {
  expect_one_sentence(run({"call", device_->url, "renew", "{x 1}"}), 1, {"schema: 1: 4: "});
  expect_one_sentence(run({"call", device_->url, "renew", "{\n x 1}"}), 1, {"schema: 2: "});
  expect_one_sentence(run({"call", device_->url, "read_flight_record", "{first: 4294967296}"}), 1,
                      {"schema: 1: ", "[0; 4294967295]", "in the field 'first'"});
  // The schema has a table around the struct, and users read the schema.
  EXPECT_EQ(run({"call", device_->url, "lease_state", "{lease: 1}"}).exit_code, 0);
  EXPECT_EQ(run({"call", device_->url, "lease_state", "{holder: {lease: 1}}"}).exit_code, 0);
  expect_one_sentence(run({"call", device_->url, "command", "{command: {sequence: 1}}"}), 1,
                      {"'command' lacks ", "force_newton", "have no defaults"});
}

TEST(GrantsOfKeys, AreRevokedByName) {
  const recording::Folder folder;
  const std::string file = folder.fresh("grants");
  Arguments authorize{"key",    "authorize", kOtherKey + " Hans Meier",
                      "--role", "observe",   "--on",
                      "**",     "--file",    file};
  expect_one_sentence(run_program("rtpm", authorize), 1,
                      {"'Hans Meier' is no name", "--name Hans-Meier"});
  EXPECT_FALSE(std::filesystem::exists(file));
  authorize.insert(authorize.end(), {"--name", "Hans-Meier"});
  EXPECT_EQ(run_program("rtpm", authorize).exit_code, 0);
  EXPECT_EQ(run_program("rtpm", {"key", "revoke", "Hans-Meier", "--file", file}).exit_code, 0);

  // The comment has blanks, as in a host's name, and quotation marks.
  const auto made = run_program(
      "rtpm", {"key", "new", "--comment", "Hans O'Meier", "--file", folder.fresh("key")});
  EXPECT_NE(made.output.find(" Hans-O-Meier' --role"), std::string::npos) << made.output;
}

TEST(CommandsWithoutARegistry, SayWhy) {
  const std::string nowhere = "rtpm://127.0.0.1:1/rtpm/names";
  const recording::Folder folder;
  const std::string file = folder.fresh("run");
  for (const char* command : {"list",
                              "list lab/arm0",
                              "info lab/arm0",
                              "find",
                              "watch",
                              "call lab/arm0 read",
                              "ping lab/arm0",
                              "echo",
                              "hz",
                              "pub lab.Touched {}",
                              "mark pause",
                              "record NEW",
                              "session --pattern NEW",
                              "config list lab/arm0",
                              "config get lab/arm0",
                              "config set lab/arm0 a=1",
                              "config save lab/arm0",
                              "config reset lab/arm0",
                              "config calibrate lab/arm0",
                              "take-over lab/arm0",
                              "estop",
                              "estop lab/arm0",
                              "flight-record lab/arm0",
                              "bind lab/cam rtpm://127.0.0.1:1/x --interface lab.X",
                              "unbind lab/cam",
                              "resolve lab/cam",
                              "version lab/arm0"}) {
    SCOPED_TRACE(command);
    Arguments arguments = words_of(command);
    std::ranges::replace(arguments, "NEW", file);
    arguments.insert(arguments.end(), {"--registry", nowhere});
    expect_one_sentence(run_program("rtpm", arguments), 3,
                        {"no registry answers at " + nowhere, "Remedy: start rtpm-registryd"});
  }
  EXPECT_FALSE(std::filesystem::exists(file));
}

}  // namespace
}  // namespace rtpm::system_test
