#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "room.hpp"
#include "rtpm/test/process.hpp"
#include "rtpm/test/text.hpp"

// The program `rtpm`, which has no generated code for the objects that it calls.
namespace rtpm::introspection {
namespace {

class Tool : public testing::Test {
 protected:
  static rtpm::test::Process::End run(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), RTPM_TOOL);
    const auto end = rtpm::test::run(arguments, std::chrono::seconds{30});
    EXPECT_TRUE(end) << "rtpm does not end";
    return end.value_or(rtpm::test::Process::End{});
  }

  test::Room room_{};
  std::string light_ = room_.url("room/light");
};

TEST_F(Tool, CallsWithABareStruct) {
  const auto set = run({"call", light_, "set", "{red: 1, green: 0.5, blue: 0}"});
  EXPECT_EQ(set.exit_code, 0) << set.errors;
  EXPECT_EQ(set.output, "{}\n");
  const auto get = run({"call", light_, "get"});
  EXPECT_EQ(get.exit_code, 0) << get.errors;
  EXPECT_EQ(get.output, "{\"red\": 1.0,\"green\": 0.5,\"blue\": 0.0}\n");
}

TEST_F(Tool, CallsWithATable) {
  const auto end =
      run({"call", light_, "scene", "{name: \"dusk\", colours: [{red: 1, green: 0, blue: 0}]}"});
  EXPECT_EQ(end.exit_code, 0) << end.errors;
  EXPECT_EQ(
      end.output,
      "{\"name\": \"dusk again\",\"colours\": [{\"red\": 1.0,\"green\": 0.0,\"blue\": 0.0}]}\n");
}

TEST_F(Tool, SendsOneways) {
  const auto flash = run({"call", light_, "flash", "{red: 0, green: 0, blue: 1}"});
  EXPECT_EQ(flash.exit_code, 0) << flash.errors;
  EXPECT_EQ(flash.output, "");
  EXPECT_EQ(run({"call", light_, "get"}).output, "{\"red\": 0.0,\"green\": 0.0,\"blue\": 1.0}\n");
}

TEST_F(Tool, PrintsTheItemsOfAStream) {
  const auto fade = run({"call", light_, "fade", "{red: 1, green: 0, blue: 0}"});
  EXPECT_EQ(fade.exit_code, 0) << fade.errors;
  EXPECT_EQ(fade.output,
            "{\"red\": 1.0,\"green\": 0.0,\"blue\": 0.0}\n"
            "{\"red\": 0.5,\"green\": 0.0,\"blue\": 0.0}\n"
            "{\"red\": 0.25,\"green\": 0.0,\"blue\": 0.0}\n");
}

TEST_F(Tool, EndsAStreamAfterTheGivenTime) {
  const auto fade = run({"call", light_, "fade", "{red: -1, green: 0, blue: 0}", "--for", "200ms"});
  EXPECT_EQ(fade.exit_code, 0) << fade.errors;
  EXPECT_EQ(rtpm::test::line_count(fade.output), 3);
}

TEST_F(Tool, UsesTheDeadlineOfTheSchemaUnlessGiven) {
  const auto patience_s = [&](std::vector<std::string> options) {
    options.insert(options.begin(), {"call", light_, "patience"});
    const auto end = run(options);
    EXPECT_EQ(end.exit_code, 0) << end.errors;
    const std::size_t colon = end.output.find(':');
    return colon == end.output.npos ? 0.0 : std::stod(end.output.substr(colon + 1));
  };
  const double own = patience_s({});
  EXPECT_GT(own, 0.0);
  EXPECT_LE(own, 0.25);
  const double given = patience_s({"--deadline", "30s"});
  EXPECT_GT(given, 20.0);
  EXPECT_LE(given, 30.0);
}

TEST_F(Tool, DescribesAndLists) {
  const auto shown = run({"info", light_});
  EXPECT_EQ(shown.exit_code, 0) << shown.errors;
  rtpm::test::expect_text(shown.output,
                          {"interface   room.Light", "methods     set, get, scene", "--schema"});
  EXPECT_LE(rtpm::test::line_count(shown.output), 24);
  const auto described = run({"info", light_, "--schema"});
  EXPECT_EQ(described.exit_code, 0) << described.errors;
  EXPECT_EQ(described.output, room::LightClient::interface().schema);
  const auto listed = run({"list", light_});
  EXPECT_EQ(listed.output, "room/light  room.Light\n");
}

TEST_F(Tool, RefusesToTakeOverOtherObjectsThanDevices) {
  const auto light = run({"take-over", light_});
  EXPECT_EQ(light.exit_code, 3);
  EXPECT_NE(light.errors.find(light_), light.errors.npos) << light.errors;
  const auto refused = run({"take-over", light_, "dim"});
  EXPECT_EQ(refused.exit_code, 2);
  rtpm::test::expect_text(refused.errors, {"{recover,activate,deactivate,rearm}"});
}

TEST_F(Tool, ReportsMistakesInOneSentence) {
  struct Case {
    std::vector<std::string> arguments;
    int exit_code;
    std::string words;
  };
  const auto mute = rpc::Server::create({.name = "mute", .realtime = rt::RealtimeMode::kOff});
  ASSERT_TRUE(mute && (*mute)->start());
  const Case cases[] = {
      {{"call", light_, "dim"},
       1,
       "room.Light has no method `dim`; it has set, get, scene, flash, fade, patience"},
      {{"call", light_, "sett"}, 1, "no method `sett` (did you mean 'set'?); it has set, get"},
      {{"call", light_, "set", "{red: \"x\"}"}, 1, "the request does not fit the schema"},
      {{"call", room_.url("room/window"), "get"}, 3, "no object 'room/window' is served at"},
      {{"info", room_.url("room/lihgt")}, 3, "; most like it there: room/light, "},
      {{"call", "rtpm://127.0.0.1:1/room/light", "get"},
       3,
       "the server of rtpm://127.0.0.1:1/room/light does not answer: "},
      {{"call", (*mute)->url("room/light"), "get"}, 3, "the server describes none of its objects"},
      {{"call", "rtpm:/nonsense", "get"}, 3, ""},
      {{"call", light_}, 2, "METHOD is required; run 'rtpm call --help'"},
      {{"fly"}, 2, "unknown command 'fly'"},
      {{"list", "--registry", "rtpm://127.0.0.1:1/rtpm/names"}, 3, "no registry answers"},
  };
  for (const Case& c : cases) {
    const auto end = run(c.arguments);
    EXPECT_EQ(end.exit_code, c.exit_code) << c.words << end.output;
    EXPECT_EQ(end.output, "") << c.words;
    EXPECT_NE(end.errors.find(c.words), std::string::npos) << end.errors;
    EXPECT_EQ(rtpm::test::line_count(end.errors), 1) << end.errors;
  }
}

}  // namespace
}  // namespace rtpm::introspection
