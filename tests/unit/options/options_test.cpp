#include "rtpm/options/options.hpp"

#include <gtest/gtest.h>

#include <tuple>

#include "fixture.hpp"

namespace rtpm::options {
namespace {

using namespace std::chrono_literals;

/// One option of every kind.
struct Values {
  std::string host = "127.0.0.1";
  std::uint16_t port = 7420;
  int offset = 0;
  std::uint64_t seed = 1;
  double gain = 0.5;
  bool verbose = false;
  Duration period = 1ms;
  std::optional<Duration> limit{};
  Priority priority = 100;
  std::vector<std::string> cases{"call", "large"};
  std::string format = "table";
  rt::RealtimeMode realtime = rt::RealtimeMode::kPrefer;
  rt::WaitConfig wait{};
  std::string registry = "rtpm://127.0.0.1:7420/rtpm/names";

  friend bool operator==(const Values& left, const Values& right) {
    const auto tie = [](const Values& v) {
      return std::tie(v.host, v.port, v.offset, v.seed, v.gain, v.verbose, v.period, v.limit,
                      v.priority, v.cases, v.format, v.realtime, v.wait.strategy, v.wait.spin,
                      v.registry);
    };
    return tie(left) == tie(right);
  }
};

Values changed_values() {
  return {.host = "10.0.0.1",
          .port = 1,
          .offset = -3,
          .seed = 18446744073709551615U,
          .gain = 0.25,
          .verbose = true,
          .period = 800us,
          .limit = 5us,
          .priority = 32767,
          .cases = {"a", "b", "c"},
          .format = "json",
          .realtime = rt::RealtimeMode::kRequire,
          .wait = {.strategy = rt::WaitStrategy::kSpin, .spin = 20us},
          .registry = "rtpm://h:1/n"};
}

class OptionsTest : public Program {
 protected:
  void add(Options& options) override {
    options.add("host", values_.host, "Address to serve");
    options.add("port", values_.port, "Port to serve");
    options.add("offset", values_.offset, "Offset in samples", {-10, 10});
    options.add("seed", values_.seed, "Seed of the simulation");
    options.add("gain", values_.gain, "Gain of the loop", {0.0, 1.0});
    options.add("verbose", values_.verbose, "Say more");
    options.add("period", values_.period, "Period of the loop", {1us, 1s});
    options.add("limit", values_.limit, "Longest wake-up");
    options.add("priority", values_.priority, "Priority of the calls");
    options.add("cases", values_.cases, "Cases to run");
    options.add_choice("format", values_.format, {"table", "json"}, "Form of the result");
    options.add_realtime(values_.realtime);
    options.add_wait(values_.wait);
    options.add_registry(values_.registry);
  }
  Values values_;
};

TEST_F(OptionsTest, KeepsDefaultsWhereNothingIsGiven) {
  expect_parsed({});
  EXPECT_EQ(values_, Values{});
}

TEST_F(OptionsTest, TakesEveryKindFromFlags) {
  expect_parsed(
      words("--host 10.0.0.1 --port=1 --offset -3 --seed 18446744073709551615 --gain 0.25 "
            "--verbose --period 800us --limit 5us --priority 32767 --cases a,b --cases c "
            "--format json --realtime require --wait spin --spin 20us --registry rtpm://h:1/n"));
  EXPECT_EQ(values_, changed_values());
}

TEST_F(OptionsTest, TakesEveryKindFromTheEnvironment) {
  const std::vector<std::pair<const char*, const char*>> variables{
      {"TEST_HOST", "10.0.0.1"},
      {"TEST_PORT", "1"},
      {"TEST_OFFSET", "-3"},
      {"TEST_SEED", "18446744073709551615"},
      {"TEST_GAIN", "0.25"},
      {"TEST_VERBOSE", "true"},
      {"TEST_PERIOD", "800us"},
      {"TEST_LIMIT", "5us"},
      {"TEST_PRIORITY", "32767"},
      {"TEST_CASES", "a, b,c"},
      {"TEST_FORMAT", "json"},
      {"REALTIME", "require"},
      {"WAIT", "spin"},
      {"SPIN", "20us"},
      {"REGISTRY", "rtpm://h:1/n"}};
  for (const auto& [name, value] : variables)
    set_variable(std::string("RTPM_") + name, value);
  expect_parsed({});
  EXPECT_EQ(values_, changed_values());
}

TEST_F(OptionsTest, TakesEveryKindFromAFile) {
  expect_parsed({"--config",
                 file_with("# of the laboratory\r\n"
                           "host='10.0.0.1'   # the arm's own net\r\n"
                           "\n"
                           "  port = 1\nseed = \"18446744073709551615\"\noffset = -3\ngain = 0.25\n"
                           "verbose = true\nperiod = '800us'\nlimit = '5us'\npriority = 32767\n"
                           "cases = ['a', 'b' ,'c']\nformat = 'json'\nrealtime = 'require'\n"
                           "wait = 'spin'\nspin = '20 us'\nregistry = 'rtpm://h:1/n'")});
  EXPECT_EQ(values_, changed_values());
}

TEST_F(OptionsTest, LetsFlagsWinOverEnvironmentOverFile) {
  set_variable("RTPM_CONFIG", file_with("port = 1\noffset = 1\ngain = 0.1\nverbose = true\n"));
  set_variable("RTPM_TEST_PORT", "http");
  set_variable("RTPM_TEST_OFFSET", "2");
  expect_parsed({"--port", "3", "--verbose=false"});
  EXPECT_EQ(values_.port, 3) << "a variable that a flag overrides is not read";
  EXPECT_EQ(values_.offset, 2);
  EXPECT_EQ(values_.gain, 0.1);
  EXPECT_FALSE(values_.verbose);
}

// Programs share one environment.
TEST_F(OptionsTest, LeavesVariablesOfOtherProgramsAlone) {
  set_variable("RTPM_PORT", "http");
  set_variable("RTPM_PERIOD", "1h");
  expect_output({"--dump-config"},
                {"# RTPM_PORT in the environment is no key of this program.\n",
                 "[RTPM_TEST_PORT] (default)\nport = ", "[RTPM_REGISTRY] (default)\nregistry = "});
  EXPECT_EQ(values_, Values{});
  expect_output({"--help"}, {"RTPM_TEST_SOME_KEY"});
}

TEST_F(OptionsTest, NamesAnUnknownFlagAndTheNearestKnown) {
  expect_error({"--prot", "1"}, {"unknown flag '--prot'", "did you mean '--port'?"});
  expect_error({"--priod=1ms"}, {"unknown flag '--priod'", "did you mean '--period'?"});
  expect_error({"--dump-confg"}, {"did you mean '--dump-config'?"});
  expect_error({"-p", "1"}, {"unknown flag '-p'"});
  expect_error({"-port", "1"}, {"unknown flag '-port'", "did you mean '--port'?"});
  expect_error({"stray"}, {"unexpected argument 'stray'"});
  expect_error({"--zzzzzzzz"}, {});
  EXPECT_EQ(err_.find("did you mean"), err_.npos) << err_;
}

TEST_F(OptionsTest, NamesAnUnknownKeyWithItsLine) {
  expect_file_error("port = 1\n\nperoid = '1ms'\n",
                    {".toml:3:", "unknown key 'peroid'", "did you mean 'period'?"});
  expect_file_error("config = 'other'\n", {".toml:1:", "unknown key 'config'"});
  expect_file_error("[port]\nlow = 1\n", {".toml:1:", "port is a table, not a whole number"});
  expect_file_error("[cases]\n", {".toml:1:", "cases is a table, not "});
  expect_file_error("[lab]\nlow = 1\n", {".toml:1:", "unknown key 'lab'"});
}

TEST_F(OptionsTest, NamesAMistakeInALineOfTheFile) {
  expect_file_error("port\n", {".toml:1:5: "});
  expect_file_error("port = 1\nport = 1\n", {".toml:2:", "port"});
  expect_file_error("host = \"a\n", {".toml:1:", "string"});
  expect_file_error("port = 'abc'\n", {":1:8: port 'abc' is not a whole number from 0 to 65535"});
  expect_file_error("port = 2.5\n", {":1:8: port '2.5' is not a whole number"});
  expect_file_error("port = [1, 2]\n", {":1:8: port '1,2' is not a whole number"});
  expect_file_error("cases = [['a']]\n", {":1:10: cases is a list of tables or lists"});
  expect_file_error("seed = -1\ngain = 2\n", {":1:8: seed"});
  expect_file_error("port." + std::string(200'000, '.') + "= 1", {"its tables nest too deeply"});
  std::string across_lines = "x = [";
  for (int i = 0; i < 100; ++i)
    across_lines += "{a" + std::string(999, '.') + "a = [\n";
  expect_file_error(across_lines, {"its tables nest too deeply"});
}

// A laboratory's file has the keys of its programs, each in a table of its own.
TEST_F(OptionsTest, ReadsItsTableOfALaboratorysFile) {
  const std::string path = file_with(
      "[[program]]\nname = 'other'\nconfig.port = 1\n"
      "[[program]]\nname = 'mine'\n[program.config]\nport = 2\n");
  expect_parsed({"--config", path + "#mine"});
  EXPECT_EQ(values_.port, 2);
  expect_error({"--config", path + "#nobody"}, {path, "no [[program]] has the name 'nobody'"});
  static_cast<void>(file_with("[[program]]\nname = 'mine'\nconfig.prot = 2\n"));
  expect_error({"--config", path + "#mine"}, {path + ":3:15: unknown key 'prot'"});
}

TEST_F(OptionsTest, NamesAFileThatCannotBeRead) {
  expect_error({"--config", "/nowhere/at all"},
               {"cannot read the configuration file '/nowhere/at all'", "No such file"});
  expect_error({"--config", "/"}, {"cannot read the configuration file '/'", "directory"});
  expect_file_error(std::string(2'000'000, '#'), {"larger than 1 MiB"});
  EXPECT_EQ(parse({"--config", "/nowhere", "--help"}), 0) << err_;
}

TEST_F(OptionsTest, NamesAWrongTypeOrRangeWithWhatWasExpected) {
  expect_error({"--port", "abc"}, {"--port 'abc' is not a whole number from 0 to 65535"});
  for (const char* port : {"65536", "-1", "1.5", " 1", ""})
    expect_error({"--port", port}, {std::string("--port '") + port + "'"});
  expect_error({"--port="}, {"--port ''"});
  expect_error({"--offset", "11"}, {"from -10 to 10"});
  expect_error({"--seed", "18446744073709551616"}, {"from 0 to 18446744073709551615"});
  expect_error({"--gain", "1.1"}, {"--gain '1.1' is not a number from 0 to 1"});
  expect_error({"--gain", "nan"}, {"--gain 'nan'"});
  expect_error({"--verbose=maybe"}, {"--verbose 'maybe' is not true or false"});
  expect_error({"--period", "5"}, {"is not a time with a unit, such as 800us or 2s"});
  expect_error({"--period", "2s"}, {"of at least 1us, of at most 1s"});
  expect_error({"--limit", "5"}, {"is not off, or a time with a unit"});
  expect_error({"--priority", "32768"}, {"is not a priority, a whole number from 0"});
  expect_error({"--format", "xml"}, {"--format 'xml' is not one of table, json"});
  expect_error({"--realtime", "yes"}, {"is not one of prefer, require, off"});
  expect_error({"--wait", "sleep"}, {"is not one of adaptive, periodic, block, spin"});
  expect_error({"--port", "--verbose"}, {"--port needs a value: a whole number from 0 to 65535"});
  expect_error({"--port"}, {"--port"});
  expect_error({"--port", "1", "--port", "2"}, {"--port"});
  set_variable("RTPM_TEST_PORT", "http");
  expect_error({}, {"RTPM_TEST_PORT 'http' is not a whole number"});
}

TEST_F(OptionsTest, TakesDiscoveryWhereNoRegistryIsGiven) {
  set_variable("RTPM_DISCOVER", "lan:7@eth0");
  expect_parsed({"--registry", "rtpm://h:1/n"});
  EXPECT_EQ(values_.registry, "rtpm://h:1/n");
  expect_parsed({"--registry="});
  EXPECT_EQ(values_.registry, "lan:7@eth0");
  expect_parsed({"--discover", "10.0.0.5,labpc"});
  EXPECT_EQ(values_.registry, "10.0.0.5,labpc");
}

TEST_F(OptionsTest, RefusesARegistryThatIsNoUrl) {
  expect_parsed({"--registry", "rtpm://h:1/n,rtpm://[::1]:2/n"});
  for (const char* wrong : {"rtpm://127.0.0.1:7420", "rtpm://h:1/n,rtpm://h"}) {
    expect_error({"--registry", wrong}, {wrong, "is not a URL rtpm://host:port/path"});
  }
}

TEST_F(OptionsTest, DumpsAConfigurationThatReadsBackTheSame) {
  values_ = changed_values();
  values_.host = "  # \"quoted\" \\ and a\ttab\n";
  values_.registry = "";
  values_.cases.clear();
  values_.gain = 0.1 + 0.2;
  values_.limit.reset();
  const Values wanted = values_;
  expect_output({"--dump-config"}, {});
  const std::string dump = out_;
  values_ = {};
  expect_parsed({"--config", file_with(dump)});
  EXPECT_EQ(values_, wanted) << dump;
}

TEST_F(OptionsTest, DumpsValuesWithTheirOrigin) {
  set_variable("RTPM_TEST_GAIN", "0.75");
  const std::string path = file_with("offset = 2\n");
  expect_output({"--port", "9", "--dump-config", "--config", path},
                {"(--port)\nport = 9\n", "(RTPM_TEST_GAIN)\ngain = 0.75\n",
                 "(default)\nhost = \"127.0.0.1\"\n", "(" + path + ":1:10)\noffset = 2\n"});
}

TEST_F(OptionsTest, PrintsHelpAndVersion) {
  for (const char* const flag : {"--help", "-h", "--help-all"}) {
    expect_output({flag}, {"rtpm-test: tries options", "--port NUMBER", "Port to serve [7420]",
                           "--verbose ", "--dump-config"});
    const bool is_all = out_.find("--realtime prefer|require|off") != out_.npos;
    EXPECT_EQ(is_all, flag == std::string("--help-all")) << out_;
  }
  expect_output({"--version"}, {"rtpm-test "});
  EXPECT_GT(out_.size(), std::string("rtpm-test \n").size()) << out_;
}

TEST_F(OptionsTest, LetsAProgramReportItsOwnFindings) {
  const Options options("rtpm-test", "tries options");
  testing::internal::CaptureStderr();
  EXPECT_EQ(options.usage_error("no case is called 'x'"), 2);
  EXPECT_EQ(testing::internal::GetCapturedStderr(),
            "rtpm-test: no case is called 'x'; run 'rtpm-test --help' for what there is\n");
}

class Secret : public Program {
 protected:
  void add(Options& options) override {
    secret_.clear();
    options.add_secret("password", secret_, "What the broker asks for");
  }
  std::string secret_;
};

TEST_F(Secret, ComesFromEnvironmentOrFileAndIsNeverPrinted) {
  set_variable("RTPM_TEST_PASSWORD", "of-the-environment");
  for (const char* flag : {"--help", "--dump-config"}) {
    expect_output({flag}, {"RTPM_TEST_PASSWORD"});
    EXPECT_EQ(out_.find("of-the-environment"), out_.npos) << out_;
  }
  expect_parsed({"--config", file_with(out_)});
  EXPECT_EQ(secret_, "of-the-environment") << "the dump leaves it as it is";
  unsetenv("RTPM_TEST_PASSWORD");
  const std::string file = file_with("password = 'of-the-file'\n");
  expect_parsed({"--config", file});
  EXPECT_EQ(secret_, "of-the-file");
  expect_output({"--config", file, "--dump-config"}, {"not printed"});
  EXPECT_EQ(out_.find("of-the-file"), out_.npos) << out_;
}

TEST_F(Secret, IsNotPrintedWhereItsTypeIsWrong) {
  expect_file_error("password = ['hidden', 'too']\n", {":1:12: password is not a text"});
  EXPECT_EQ(err_.find("hidden"), err_.npos) << err_;
}

TEST_F(Secret, IsRefusedAsAFlag) {
  for (const Arguments& arguments : {Arguments{"--password", "word"}, {"--password=word"}}) {
    expect_error(arguments, {"--password would show it", "RTPM_TEST_PASSWORD", "--config"});
    EXPECT_EQ(err_.find("word;"), err_.npos) << err_;
    EXPECT_EQ(secret_, "");
  }
}

using OptionsDeathTest = OptionsTest;

TEST_F(OptionsDeathTest, RejectsDuplicateKeys) {
  int value = 0;
  Options options("rtpm-test", "tries options");
  options.add("key", value, "A key");
  EXPECT_DEATH(options.add("key", value, "Again"), "key is already added");
  EXPECT_DEATH(options.add("help", value, "Taken"), "already added");
  EXPECT_DEATH(options.add("config", value, "Taken"), "already added");
}

/// A program with members, each with a rate.
class Members : public Program {
 protected:
  void add(Options& options) override {
    options.add_group("members", "member", names_, "Each with a rate", 64,
                      [this, &options](const std::vector<std::string>& names) {
                        rates_.assign(names.size(), 0);
                        for (std::size_t i = 0; i < names.size(); ++i) {
                          options.of_member("member", names[i]).add("rate", rates_[i], "Its rate");
                        }
                      });
  }
  std::vector<std::string> names_{"one"};
  std::vector<std::uint32_t> rates_{};
};

TEST_F(Members, HaveNamesThatRegistriesAccept) {
  set_variable("RTPM_TEST_MEMBER_LEFT_ARM_2_RATE", "7");
  const std::string file = file_with("[member.Hand]\nrate = 5\n");
  expect_parsed({"--members", "Left_Arm.2,Hand,x-1", "--config", file, "--member-x-1-rate", "9"});
  EXPECT_EQ(names_, (std::vector<std::string>{"Left_Arm.2", "Hand", "x-1"}));
  EXPECT_EQ(rates_, (std::vector<std::uint32_t>{7, 5, 9}));
  expect_parsed({"--members", std::string(64, 'a')});
  // Names that collide in the environment, have bad characters, or are too long.
  for (const std::string& names :
       {std::string("arm-1,Arm_1"), std::string("a,a"), std::string("a/b"), std::string("a b"),
        std::string("a:1"), std::string(65, 'a'), std::string()})
    expect_error({"--members", names}, {"letters, digits, '.', '_' and '-', of up to 64 bytes"});
}

TEST_F(Members, DefaultToTheTablesOfTheFile) {
  const std::string file = file_with("[member.two]\n[member.\"one.a\"]\nrate = 5\n");
  expect_parsed({"--config", file});
  EXPECT_EQ(names_, (std::vector<std::string>{"one", "two", "one.a"}));
  EXPECT_EQ(rates_, (std::vector<std::uint32_t>{0, 0, 5}));
  expect_error({"--config", file, "--members", "two"}, {"unknown key 'member.\"one.a\"'"});
}

}  // namespace
}  // namespace rtpm::options
