#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "fixture.hpp"

// Sessions and markers that a browser starts and sets.
namespace rtpm::system_test {
namespace {

class Sessions : public ConsoleSystem {};

TEST_F(Sessions, HaveTheMarksOfBrowsersAtTheirTimes) {
  const auto client = connect_to_arm();
  client->subscribe("console/state");
  client->subscribe("console/marks");
  const Json first = client->await_message(
      "console/marks", [](const Json& one) { return one.contains("is_first"); });
  EXPECT_TRUE(first["marks"].empty());
  const Json started =
      client->call("console/session_start", {{"participant", "P07"},
                                             {"experiment", "touch"},
                                             {"condition", "soft"},
                                             {"notes", "left hand"},
                                             {"pattern", "{experiment}_{participant}"},
                                             {"devices", {"lab/arm0"}}});
  ASSERT_EQ(started, Json({{"file", "touch_P07.mcap"}}));
  const Json state = client->await_state(
      [](const Json& one) { return one["recording"]["file"] == "touch_P07.mcap"; });
  EXPECT_EQ(state["recording"]["session"]["participant"], "P07");

  const auto now_ns = state["time_ns"].get<std::uint64_t>();
  const Json begun = client->call("console/mark", {{"phase", "begin"},
                                                   {"number", 1},
                                                   {"condition", "soft"},
                                                   {"time_ns", now_ns - 2'000'000'000},
                                                   {"id", 7}});
  EXPECT_EQ(begun["time_ns"], now_ns - 2'000'000'000) << begun;
  const Json ended = client->call(
      "console/mark", {{"phase", "end"}, {"number", 1}, {"response", "left"}, {"time_ns", now_ns}});
  EXPECT_NEAR(ended["duration_ns"].get<double>(), 2e9, 1e6) << "a trial is an interval";
  // A request whose answer was lost is set once.
  EXPECT_EQ(client->call("console/mark", {{"phase", "begin"}, {"number", 1}, {"id", 7}}),
            Json({{"ok", true}}));
  Json end;
  static_cast<void>(client->await_message("console/marks", [&](const Json& one) {
    for (const Json& mark : one["marks"])
      if (mark["phase"] == "end") end = mark;
    return !end.is_null();
  }));
  EXPECT_EQ(end["condition"], "soft") << "an end describes the whole trial";
  EXPECT_EQ(end["response"], "left");

  const Json stopped = client->call("console/session_stop", Json::object());
  EXPECT_EQ(stopped["file"], "touch_P07.mcap");
  EXPECT_EQ(stopped["missing"], Json::array());
  const std::string path = folder_ + "/recordings/touch_P07.mcap";
  const Json info =
      Json::parse(rtpm({"bag", "info", path, "--json"}).output, nullptr, /*exceptions=*/false);
  EXPECT_EQ(info["session"]["notes"], "left hand");
  ASSERT_EQ(info["parameters"].size(), 1u);
  EXPECT_EQ(info["parameters"][0]["device"], "lab/arm0");
  std::uint64_t trial_count = 0;
  for (const Json& channel : info["channels"])
    if (channel["topic"] == "rtpm.Trial/0") trial_count = channel["message_count"];
  EXPECT_EQ(trial_count, 2u);
}

TEST_F(Sessions, RefuseWithASentenceWhatTheyCantTake) {
  const auto client = connect_to_arm();
  const auto failure_of = [&](const char* service, const Json& request) {
    const Json answer = client->call(service, request);
    return answer.contains("failure") ? answer["failure"].get<std::string>() : answer.dump();
  };
  using std::string;
  const auto has = [](const string& text, const char* words) {
    return text.find(words) != string::npos;
  };
  EXPECT_PRED2(has, failure_of("console/session_start", {{"pattern", "{subject}"}}),
               "{participant}");
  EXPECT_PRED2(has, failure_of("console/session_start", {{"pattern", "../{date}"}}), "no name");
  EXPECT_PRED2(has, failure_of("console/session_start", {{"participant", string(200, 'x')}}),
               "too long");
  EXPECT_PRED2(has, failure_of("console/session_start", {{"topics", {"lab.Nothing"}}}),
               "lab.Nothing");
  EXPECT_PRED2(has, failure_of("console/session_stop", Json::object()), "nothing is being");
  EXPECT_PRED2(has, failure_of("console/mark", Json::object()), "nothing to mark");
  EXPECT_PRED2(has, failure_of("console/mark", {{"label", 7}}), "no text");
  EXPECT_PRED2(has, failure_of("console/mark", {{"label", "\x1b[2J"}}), "can't be shown");
  EXPECT_PRED2(has, failure_of("console/mark", {{"phase", "begin"}}), "number");
  EXPECT_PRED2(has, failure_of("console/mark", {{"phase", "middle"}, {"label", "x"}}), "begin");
  EXPECT_TRUE(std::filesystem::is_empty(folder_ + "/recordings")) << "nothing was recorded";
}

TEST_F(Sessions, OverwriteNoFile) {
  const auto client = connect_to_arm();
  for (const char* const file : {"P07.mcap", "P07-2.mcap"}) {
    const Json started = client->call("console/session_start",
                                      {{"participant", "P07"}, {"pattern", "{participant}"}});
    EXPECT_EQ(started["file"], file);
    EXPECT_TRUE(client->call("console/session_start", Json::object()).contains("failure"))
        << "one at a time";
    EXPECT_EQ(client->call("console/session_stop", Json::object())["file"], file);
  }
}

}  // namespace
}  // namespace rtpm::system_test
