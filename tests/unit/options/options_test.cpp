#include "rtpm/options/options.hpp"

#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>

namespace rtpm::options {
namespace {

using namespace std::chrono_literals;

/// The result and the output of a run of parse().
struct Outcome {
  std::optional<int> exit_code;
  std::string out;
  std::string err;
};

/// One option of every kind.
struct Values {
  std::string host = "127.0.0.1";
  std::uint16_t port = 7420;
  int offset = 0;
  std::uint64_t seed = 1;
  double gain = 0.5;
  bool verbose = false;
  Duration period = 1ms;
  Priority priority = 100;
  std::vector<std::string> cases{"call", "large"};
  std::string format = "table";
  rt::RealtimeMode realtime = rt::RealtimeMode::kPrefer;
  rt::WaitConfig wait{};
  std::string registry = "rtpm://127.0.0.1:7420/rtpm/names";

  friend bool operator==(const Values& left, const Values& right) {
    const auto tie = [](const Values& v) {
      return std::tie(v.host, v.port, v.offset, v.seed, v.gain, v.verbose, v.period, v.priority,
                      v.cases, v.format, v.realtime, v.wait.strategy, v.wait.spin, v.registry);
    };
    return tie(left) == tie(right);
  }
};

class OptionsTest : public testing::Test {
 protected:
  void TearDown() override {
    for (const auto& [name, value] : environment_)
      unsetenv(name.c_str());
    if (!path_.empty()) std::filesystem::remove(path_);
  }

  void set_variable(const std::string& name, const std::string& value) {
    environment_[name] = value;
    setenv(name.c_str(), value.c_str(), 1);
  }

  /// A file with `text`, which is removed after the test.
  std::string file_with(const std::string& text) {
    if (path_.empty()) {
      path_ = testing::TempDir() + "options_test_XXXXXX";
      const int file = mkstemp(path_.data());
      EXPECT_GE(file, 0);
      std::fclose(fdopen(file, "w"));
    }
    std::ofstream(path_) << text;
    return path_;
  }

  Outcome parse(const std::vector<std::string>& arguments) {
    return parse_into(values_, arguments, [](Options&) {});
  }

  static Outcome parse_into(Values& values, const std::vector<std::string>& arguments,
                            const std::function<void(Options&)>& add_more) {
    Options options("rtpm-test", "tries options");
    options.add("host", values.host, "Address to serve");
    options.add("port", values.port, "Port to serve");
    options.add("offset", values.offset, "Offset in samples", {-10, 10});
    options.add("seed", values.seed, "Seed of the simulation");
    options.add("gain", values.gain, "Gain of the loop", {0.0, 1.0});
    options.add("verbose", values.verbose, "Say more");
    options.add("period", values.period, "Period of the loop", {1us, 1s});
    options.add("priority", values.priority, "Priority of the calls");
    options.add("cases", values.cases, "Cases to run");
    options.add_choice("format", values.format, {"table", "json"}, "Form of the result");
    options.add_realtime(values.realtime);
    options.add_wait(values.wait);
    options.add_registry(values.registry);
    add_more(options);
    std::vector<const char*> argv{"rtpm-test"};
    for (const std::string& argument : arguments)
      argv.push_back(argument.c_str());
    Outcome outcome;
    testing::internal::CaptureStdout();
    testing::internal::CaptureStderr();
    outcome.exit_code = options.parse(static_cast<int>(argv.size()), argv.data());
    outcome.out = testing::internal::GetCapturedStdout();
    outcome.err = testing::internal::GetCapturedStderr();
    return outcome;
  }

  /// Expects an error of one line that contains all of `parts`.
  void expect_error(const std::vector<std::string>& arguments,
                    const std::vector<std::string>& parts) {
    const Outcome outcome = parse(arguments);
    EXPECT_EQ(outcome.exit_code, 2);
    EXPECT_EQ(outcome.out, "");
    EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
    EXPECT_TRUE(outcome.err.starts_with("rtpm-test: ")) << outcome.err;
    EXPECT_NE(outcome.err.find("run 'rtpm-test --help'"), std::string::npos) << outcome.err;
    for (const std::string& part : parts) {
      EXPECT_NE(outcome.err.find(part), std::string::npos) << part << " in: " << outcome.err;
    }
  }

  Values values_;

 private:
  std::map<std::string, std::string> environment_;
  std::string path_;
};

Values changed_values() {
  return {.host = "10.0.0.1",
          .port = 1,
          .offset = -3,
          .seed = 18446744073709551615U,
          .gain = 0.25,
          .verbose = true,
          .period = 800us,
          .priority = 32767,
          .cases = {"a", "b", "c"},
          .format = "json",
          .realtime = rt::RealtimeMode::kRequire,
          .wait = {.strategy = rt::WaitStrategy::kSpin, .spin = 20us},
          .registry = "rtpm://h:1/n"};
}

TEST_F(OptionsTest, KeepsDefaultsWhereNothingIsGiven) {
  const Outcome outcome = parse({});
  EXPECT_EQ(outcome.exit_code, std::nullopt);
  EXPECT_EQ(outcome.out + outcome.err, "");
  EXPECT_EQ(values_, Values{});
}

TEST_F(OptionsTest, TakesEveryKindFromFlags) {
  const Outcome outcome = parse({"--host",
                                 "10.0.0.1",
                                 "--port=1",
                                 "--offset",
                                 "-3",
                                 "--seed",
                                 "18446744073709551615",
                                 "--gain",
                                 "0.25",
                                 "--verbose",
                                 "--period",
                                 "800us",
                                 "--priority",
                                 "32767",
                                 "--cases",
                                 "a,b",
                                 "--cases",
                                 "c",
                                 "--format",
                                 "json",
                                 "--realtime",
                                 "require",
                                 "--wait",
                                 "spin",
                                 "--spin",
                                 "20us",
                                 "--registry",
                                 "rtpm://h:1/n"});
  EXPECT_EQ(outcome.exit_code, std::nullopt) << outcome.err;
  EXPECT_EQ(values_, changed_values());
}

TEST_F(OptionsTest, TakesEveryKindFromTheEnvironment) {
  for (const auto& [name, value] :
       std::map<std::string, std::string>{{"RTPM_TEST_HOST", "10.0.0.1"},
                                          {"RTPM_TEST_PORT", "1"},
                                          {"RTPM_TEST_OFFSET", "-3"},
                                          {"RTPM_TEST_SEED", "18446744073709551615"},
                                          {"RTPM_TEST_GAIN", "0.25"},
                                          {"RTPM_TEST_VERBOSE", "true"},
                                          {"RTPM_TEST_PERIOD", "800us"},
                                          {"RTPM_TEST_PRIORITY", "32767"},
                                          {"RTPM_TEST_CASES", "a, b,c"},
                                          {"RTPM_TEST_FORMAT", "json"},
                                          {"RTPM_REALTIME", "require"},
                                          {"RTPM_WAIT", "spin"},
                                          {"RTPM_SPIN", "20us"},
                                          {"RTPM_REGISTRY", "rtpm://h:1/n"}}) {
    set_variable(name, value);
  }
  const Outcome outcome = parse({});
  EXPECT_EQ(outcome.exit_code, std::nullopt) << outcome.err;
  EXPECT_EQ(values_, changed_values());
}

TEST_F(OptionsTest, TakesEveryKindFromAFile) {
  const std::string path = file_with(
      "# of the laboratory\r\n"
      "host='10.0.0.1'   # the arm's own net\r\n"
      "\n"
      "  port = 1\nseed = \"18446744073709551615\"\noffset = -3\ngain = 0.25\nverbose = true\n"
      "period = '800us'\npriority = 32767\ncases = ['a', 'b' ,'c']\nformat = 'json'\n"
      "realtime = 'require'\nwait = 'spin'\nspin = '20 us'\nregistry = 'rtpm://h:1/n'");
  const Outcome outcome = parse({"--config", path});
  EXPECT_EQ(outcome.exit_code, std::nullopt) << outcome.err;
  EXPECT_EQ(values_, changed_values());
}

TEST_F(OptionsTest, LetsFlagsWinOverEnvironmentOverFile) {
  const std::string path = file_with("port = 1\noffset = 1\ngain = 0.1\n");
  set_variable("RTPM_TEST_PORT", "2");
  set_variable("RTPM_TEST_OFFSET", "2");
  const Outcome outcome = parse({"--port", "3", "--config", path});
  EXPECT_EQ(outcome.exit_code, std::nullopt) << outcome.err;
  EXPECT_EQ(values_.port, 3);
  EXPECT_EQ(values_.offset, 2);
  EXPECT_EQ(values_.gain, 0.1);
}

TEST_F(OptionsTest, FindsTheFileByTheEnvironmentToo) {
  set_variable("RTPM_CONFIG", file_with("port = 5\n"));
  EXPECT_EQ(parse({}).exit_code, std::nullopt);
  EXPECT_EQ(values_.port, 5);
}

// Programs share one environment.
TEST_F(OptionsTest, LeavesVariablesOfOtherProgramsAlone) {
  set_variable("RTPM_PORT", "http");
  set_variable("RTPM_PERIOD", "1h");
  const Outcome outcome = parse({"--dump-config"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(values_, Values{});
  for (const char* words :
       {"# RTPM_PORT in the environment is no key of this program, which has RTPM_TEST_PORT.\n",
        "[RTPM_TEST_PORT] (default)\nport = ", "[RTPM_REGISTRY] (default)\nregistry = "}) {
    EXPECT_NE(outcome.out.find(words), std::string::npos) << words << outcome.out;
  }
  const Outcome help = parse({"--help"});
  EXPECT_NE(help.out.find("RTPM_TEST_SOME_KEY"), std::string::npos) << help.out;
}

TEST_F(OptionsTest, LetsAFlagSwitchOff) {
  set_variable("RTPM_TEST_VERBOSE", "true");
  EXPECT_EQ(parse({"--verbose=false"}).exit_code, std::nullopt);
  EXPECT_FALSE(values_.verbose);
}

TEST_F(OptionsTest, NamesAnUnknownFlagAndTheNearestKnown) {
  expect_error({"--prot", "1"}, {"unknown flag '--prot'", "did you mean '--port'?"});
  expect_error({"--priod=1ms"}, {"unknown flag '--priod'", "did you mean '--period'?"});
  expect_error({"--dump-confg"}, {"did you mean '--dump-config'?"});
  expect_error({"-p", "1"}, {"unknown flag '-p'"});
  expect_error({"-port", "1"}, {"unknown flag '-port'", "did you mean '--port'?"});
  const Outcome far = parse({"--zzzzzzzz"});
  EXPECT_EQ(far.err.find("did you mean"), std::string::npos) << far.err;
}

TEST_F(OptionsTest, NamesAnUnknownKeyWithItsLine) {
  const std::string path = file_with("port = 1\n\nperoid = '1ms'\n");
  expect_error({"--config", path},
               {path + ":3:", "unknown key 'peroid'", "did you mean 'period'?"});
  file_with("config = 'other'\n");
  expect_error({"--config", path}, {path + ":1:", "unknown key 'config'"});
  file_with("[port]\nlow = 1\n");
  expect_error({"--config", path}, {path + ":1:", "port is a table"});
  file_with("[lab]\nlow = 1\n");
  expect_error({"--config", path}, {path + ":1:", "unknown key 'lab'"});
}

TEST_F(OptionsTest, NamesAMistakeInALineOfTheFile) {
  const std::string path = file_with("port\n");
  expect_error({"--config", path}, {path + ":1:5: "});
  file_with("port = 1\nport = 1\n");
  expect_error({"--config", path}, {path + ":2:", "port"});
  file_with("host = \"a\n");
  expect_error({"--config", path}, {path + ":1:", "string"});
  file_with("port = 'abc'\n");
  expect_error({"--config", path}, {":1:8: port 'abc' is not a whole number from 0 to 65535"});
  file_with("port = 2.5\n");
  expect_error({"--config", path}, {":1:8: port '2.5' is not a whole number"});
  file_with("port = [1, 2]\n");
  expect_error({"--config", path}, {":1:8: port '1,2' is not a whole number"});
  file_with("cases = [['a']]\n");
  expect_error({"--config", path}, {":1:10: cases is a list of tables or lists"});
  file_with("port." + std::string(200'000, '.') + "= 1");
  expect_error({"--config", path}, {path + ": its tables nest too deeply"});
  std::string across_lines = "x = [";
  for (int i = 0; i < 100; ++i)
    across_lines += "{a" + std::string(999, '.') + "a = [\n";
  file_with(across_lines);
  expect_error({"--config", path}, {path + ": its tables nest too deeply"});
}

// A laboratory's file has the keys of its programs, each in a table of its own.
TEST_F(OptionsTest, ReadsItsTableOfALaboratorysFile) {
  const std::string path = file_with(
      "[[program]]\nname = 'other'\nconfig.port = 1\n"
      "[[program]]\nname = 'mine'\n[program.config]\nport = 2\n");
  EXPECT_EQ(parse({"--config", path + "#mine"}).exit_code, std::nullopt);
  EXPECT_EQ(values_.port, 2);
  expect_error({"--config", path + "#nobody"}, {path, "no [[program]] has the name 'nobody'"});
  file_with("[[program]]\nname = 'mine'\nconfig.prot = 2\n");
  expect_error({"--config", path + "#mine"}, {path + ":3:15: unknown key 'prot'"});
}

TEST_F(OptionsTest, NamesAFileThatCannotBeRead) {
  expect_error({"--config", "/nowhere/at all"},
               {"cannot read the configuration file '/nowhere/at all'", "No such file"});
  expect_error({"--config", "/"}, {"cannot read the configuration file '/'", "directory"});
  const std::string path = file_with(std::string(2'000'000, '#'));
  expect_error({"--config", path}, {"larger than 1 MiB"});
}

TEST_F(OptionsTest, NamesAWrongTypeOrRangeWithWhatWasExpected) {
  expect_error({"--port", "abc"}, {"--port 'abc' is not a whole number from 0 to 65535"});
  expect_error({"--port", "65536"}, {"--port '65536' is not a whole number from 0 to 65535"});
  expect_error({"--port", "-1"}, {"--port '-1'"});
  expect_error({"--port", "1.5"}, {"--port '1.5'"});
  expect_error({"--port", " 1"}, {"--port ' 1'"});
  expect_error({"--port="}, {"--port ''"});
  expect_error({"--offset", "11"}, {"from -10 to 10"});
  expect_error({"--seed", "18446744073709551616"}, {"from 0 to 18446744073709551615"});
  expect_error({"--gain", "1.1"}, {"--gain '1.1' is not a number from 0 to 1"});
  expect_error({"--gain", "nan"}, {"--gain 'nan'"});
  expect_error({"--verbose=maybe"}, {"--verbose 'maybe' is not true or false"});
  expect_error({"--period", "5"}, {"is not a time with a unit, such as 800us or 2s"});
  expect_error({"--period", "2s"}, {"of at least 1us, of at most 1s"});
  expect_error({"--priority", "32768"}, {"is not a priority, a whole number from 0"});
  expect_error({"--cases", "a,,b"}, {"--cases 'a,,b' is not a list with commas"});
  expect_error({"--format", "xml"}, {"--format 'xml' is not table or json"});
  expect_error({"--realtime", "yes"}, {"is not prefer, require or off"});
  expect_error({"--wait", "sleep"}, {"is not adaptive, periodic, block or spin"});
  set_variable("RTPM_TEST_PORT", "http");
  expect_error({}, {"RTPM_TEST_PORT 'http' is not a whole number"});
}

TEST_F(OptionsTest, IgnoresAVariableThatAFlagOverrides) {
  set_variable("RTPM_TEST_PORT", "http");
  EXPECT_EQ(parse({"--port", "1"}).exit_code, std::nullopt);
}

TEST_F(OptionsTest, NamesAFlagWithoutItsValueAndAFlagGivenTwice) {
  expect_error({"--port"}, {"--port needs a value: a whole number from 0 to 65535"});
  expect_error({"--port", "--verbose"}, {"--port needs a value"});
  expect_error({"--port", "1", "--port", "2"}, {"--port is given twice"});
}

TEST_F(OptionsTest, IgnoresVariablesOfOtherPrograms) {
  set_variable("RTPM_OTHER_PROGRAMS_KEY", "1");
  EXPECT_EQ(parse({}).exit_code, std::nullopt);
  const Outcome dump = parse({"--dump-config"});
  EXPECT_NE(dump.out.find("# RTPM_OTHER_PROGRAMS_KEY in the environment is no key"),
            std::string::npos);
}

TEST_F(OptionsTest, TakesDiscoveryWhereNoRegistryIsGiven) {
  set_variable("RTPM_DISCOVER", "lan:7@eth0");
  EXPECT_EQ(parse({"--registry", "rtpm://h:1/n"}).exit_code, std::nullopt);
  EXPECT_EQ(values_.registry, "rtpm://h:1/n");
  values_.registry = "host";
  EXPECT_EQ(parse({}).exit_code, std::nullopt);
  EXPECT_EQ(values_.registry, "lan:7@eth0");
  values_.registry = "host";
  EXPECT_EQ(parse({"--discover", "10.0.0.5,labpc"}).exit_code, std::nullopt);
  EXPECT_EQ(values_.registry, "10.0.0.5,labpc");
}

TEST_F(OptionsTest, DumpsAConfigurationThatReadsBackTheSame) {
  Values values = changed_values();
  values.host = "  # \"quoted\" \\ and a\ttab\n";
  values.registry = "";
  values.cases.clear();
  values.gain = 0.1 + 0.2;
  const Values wanted = values;
  const Outcome dump = parse_into(values, {"--dump-config"}, [](Options&) {});
  EXPECT_EQ(dump.exit_code, 0);
  EXPECT_EQ(dump.err, "");
  EXPECT_EQ(parse({"--config", file_with(dump.out)}).exit_code, std::nullopt) << dump.out;
  EXPECT_EQ(values_, wanted) << dump.out;
}

TEST_F(OptionsTest, TakesASecretFromEnvironmentAndFileAndNeverPrintsIt) {
  std::string secret;
  const auto with_secret = [&](const std::vector<std::string>& arguments) {
    secret.clear();
    return parse_into(values_, arguments, [&](Options& options) {
      options.add_secret("password", secret, "What the broker asks for");
    });
  };
  set_variable("RTPM_TEST_PASSWORD", "of-the-environment");
  for (const char* flag : {"--dump-config", "--help"}) {
    const Outcome outcome = with_secret({flag});
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    EXPECT_NE(outcome.out.find("RTPM_TEST_PASSWORD"), std::string::npos) << outcome.out;
    EXPECT_EQ(outcome.out.find("of-the-environment"), std::string::npos) << outcome.out;
    EXPECT_EQ(outcome.out.find("--password"), std::string::npos) << outcome.out;
  }
  const std::string dumped = with_secret({"--dump-config"}).out;
  EXPECT_EQ(with_secret({"--config", file_with(dumped)}).exit_code, std::nullopt);
  EXPECT_EQ(secret, "of-the-environment") << "the dump leaves it as it is";
  unsetenv("RTPM_TEST_PASSWORD");
  const std::string file = file_with("password = 'of-the-file'\n");
  EXPECT_EQ(with_secret({"--config", file}).exit_code, std::nullopt);
  EXPECT_EQ(secret, "of-the-file");
  EXPECT_EQ(with_secret({"--config", file, "--dump-config"}).out.find("of-the-file"),
            std::string::npos);
  for (const std::vector<std::string>& public_arguments :
       {std::vector<std::string>{"--password", "word"}, {"--password=word"}, {"--password"}}) {
    const Outcome refused = with_secret(public_arguments);
    EXPECT_EQ(refused.exit_code, 2);
    for (const char* words : {"--password would show it", "RTPM_TEST_PASSWORD", "--config"})
      EXPECT_NE(refused.err.find(words), std::string::npos) << refused.err;
    EXPECT_EQ(refused.err.find("word;"), std::string::npos) << refused.err;
  }
}

TEST_F(OptionsTest, DumpsValuesWithTheirOrigin) {
  set_variable("RTPM_TEST_GAIN", "0.75");
  const std::string path = file_with("offset = 2\n");
  const Outcome dump = parse({"--port", "9", "--dump-config", "--config", path});
  EXPECT_EQ(dump.exit_code, 0);
  for (const char* const part : {"(--port)\nport = 9\n", "(RTPM_TEST_GAIN)\ngain = 0.75\n",
                                 "(default)\nhost = \"127.0.0.1\"\n"}) {
    EXPECT_NE(dump.out.find(part), std::string::npos) << part << " in:\n" << dump.out;
  }
  EXPECT_NE(dump.out.find("(" + path + ":1:10)\noffset = 2\n"), std::string::npos) << dump.out;
}

TEST_F(OptionsTest, PrintsHelpAndVersion) {
  for (const char* const flag : {"--help", "-h", "--help-all"}) {
    const Outcome help = parse({flag});
    EXPECT_EQ(help.exit_code, 0);
    EXPECT_EQ(help.err, "");
    for (const char* const part : {"rtpm-test: tries options", "--port NUMBER",
                                   "Port to serve [7420]", "--verbose ", "--dump-config"})
      EXPECT_NE(help.out.find(part), std::string::npos) << part << " in:\n" << help.out;
    const bool is_all = help.out.find("--realtime prefer|require|off") != std::string::npos;
    EXPECT_EQ(is_all, flag == std::string("--help-all")) << help.out;
  }
  const Outcome version = parse({"--version"});
  EXPECT_EQ(version.exit_code, 0);
  EXPECT_TRUE(version.out.starts_with("rtpm-test ")) << version.out;
  EXPECT_GT(version.out.size(), std::string("rtpm-test \n").size()) << version.out;
}

TEST_F(OptionsTest, RefusesAnUnexpectedArgument) {
  expect_error({"stray"}, {"unexpected argument 'stray'"});
}

TEST_F(OptionsTest, LetsAProgramReportItsOwnFindings) {
  const Options options("rtpm-test", "tries options");
  testing::internal::CaptureStderr();
  EXPECT_EQ(options.usage_error("no case is called 'x'"), 2);
  EXPECT_EQ(testing::internal::GetCapturedStderr(),
            "rtpm-test: no case is called 'x'; run 'rtpm-test --help' for what there is\n");
}

using OptionsDeathTest = OptionsTest;

TEST_F(OptionsDeathTest, RejectsDuplicateAndMalformedKeys) {
  int value = 0;
  Options options("rtpm-test", "tries options");
  options.add("key", value, "A key");
  EXPECT_DEATH(options.add("key", value, "Again"), "in use");
  EXPECT_DEATH(options.add("help", value, "Taken"), "in use");
  EXPECT_DEATH(options.add("config", value, "Taken"), "in use");
  EXPECT_DEATH(options.add("Key_2", value, "Malformed"), "lower-case");
}

/// The members with names at a registry that a group reads from `arguments`.
class Members : public OptionsTest {
 protected:
  std::optional<int> take(const std::vector<std::string>& arguments) {
    Values values;
    const auto outcome = parse_into(values, arguments, [this](Options& options) {
      options.add_group("members", "member", names_, "Each with a rate", 64,
                        [this, &options](const std::vector<std::string>& names) {
                          rates_.assign(names.size(), 0);
                          for (std::size_t i = 0; i < names.size(); ++i) {
                            const auto scope =
                                Options::Scope::of_member(options, "member", names[i]);
                            options.add("rate", rates_[i], "Its rate");
                          }
                        });
    });
    err_ = outcome.err;
    return outcome.exit_code;
  }
  std::vector<std::string> names_{"one"};
  std::vector<std::uint32_t> rates_{};
  std::string err_{};
};

TEST_F(Members, HaveNamesThatRegistriesAccept) {
  set_variable("RTPM_TEST_MEMBER_LEFT_ARM_2_RATE", "7");
  const std::string file = file_with("[member.Hand]\nrate = 5\n");
  EXPECT_FALSE(
      take({"--members", "Left_Arm.2,Hand,x-1", "--config", file, "--member-x-1-rate", "9"}))
      << err_;
  EXPECT_EQ(names_, (std::vector<std::string>{"Left_Arm.2", "Hand", "x-1"}));
  EXPECT_EQ(rates_, (std::vector<std::uint32_t>{7, 5, 9}));
  EXPECT_FALSE(take({"--members", std::string(64, 'a')})) << err_;
  // Names that collide in the environment, have bad characters, or are too long.
  for (const std::string& names : {std::string("arm-1,Arm_1"), std::string("a/b"),
                                   std::string("a b"), std::string("a:1"), std::string(65, 'a')}) {
    EXPECT_EQ(take({"--members", names}), 2) << names;
    EXPECT_NE(err_.find("letters, digits, '.', '_' and '-'"), std::string::npos) << err_;
  }
}

TEST_F(Members, DefaultToTheTablesOfTheFile) {
  const std::string file = file_with("[member.two]\n[member.\"one.a\"]\nrate = 5\n");
  EXPECT_FALSE(take({"--config", file})) << err_;
  EXPECT_EQ(names_, (std::vector<std::string>{"one", "two", "one.a"}));
  EXPECT_EQ(rates_, (std::vector<std::uint32_t>{0, 0, 5}));
  EXPECT_EQ(take({"--config", file, "--members", "two"}), 2);
  EXPECT_NE(err_.find("unknown key 'member.\"one.a\"'"), std::string::npos) << err_;
}

}  // namespace
}  // namespace rtpm::options
