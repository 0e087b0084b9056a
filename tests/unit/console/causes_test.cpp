#include "incidents/causes.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <string>
#include <vector>

namespace rtpm::console {
namespace {

using incidents::Cause;
using incidents::Severity;
using Json = nlohmann::ordered_json;

/// A laboratory where all is well.
Json calm() {
  return {{"uptime_s", 60},
          {"registry", {{"ok", true}}},
          {"hub", {{"name", "rtpm/events"}, {"ok", true}}},
          {"objects", {{{"name", "lab/arm0"}, {"url", "rtpm://10.0.0.7:4711/lab/arm0"}}}},
          {"servers",
           {{{"name", "rtpm-deviced"}, {"port", 4711}, {"process_id", 7}, {"alive", true}},
            {{"name", "rtpm-other"}, {"port", 99}, {"process_id", 8}, {"alive", true}}}},
          {"devices",
           {{{"name", "lab/arm0"},
             {"ok", true},
             {"lost_for_s", nullptr},
             {"faults", Json::array()},
             {"lifecycle", "active"},
             {"lease", {{"state", "free"}}}}}},
          {"not_stopped", Json::array()},
          {"recording", {{"file", ""}, {"drop_count", 0}, {"problem", ""}}}};
}

class Causes : public ::testing::Test {
 protected:
  CauseFinder::Found find(const Json& state, Duration time = Duration{0}) {
    const auto utc = static_cast<std::uint64_t>((std::chrono::hours{500'000} + time).count());
    return finder_.find(state, disks_, {.time = MonotonicTime{} + time, .utc_ns = utc + set_ns_});
  }
  static std::string words(const std::vector<Cause>& causes) {
    std::string text;
    for (const Cause& cause : causes)
      text += (text.empty() ? "" : "; ") + cause.who + " " + cause.what;
    return text;
  }
  CauseFinder finder_{};
  std::vector<DiskSpace> disks_{};
  std::uint64_t set_ns_ = 0;
};

TEST_F(Causes, AreNoneWhereAllIsWell) {
  const auto found = find(calm());
  EXPECT_EQ(words(found.lasting), "");
  EXPECT_EQ(words(found.events), "");
}

TEST_F(Causes, AreWhatDevicesShow) {
  Json state = calm();
  Json& device = state["devices"][0];
  device["lost_for_s"] = 2.5;
  auto found = find(state);
  EXPECT_EQ(words(found.lasting), "lab/arm0 lost");
  EXPECT_EQ(found.lasting[0].severity, Severity::kAlarm);
  EXPECT_EQ(found.lasting[0].since_ns, 500'000 * 3'600'000'000'000ull - 2'500'000'000ull);
  device["lost_for_s"] = nullptr;
  device["ok"] = false;
  device["is_stopped"] = true;
  device["faults"] = {"emergency stop", "too fast", "force clamped", "soft start"};
  EXPECT_EQ(words(find(state).lasting), "lab/arm0 stopped; lab/arm0 fault; lab/arm0 limit")
      << "a single answer may be late";
  found = find(state, std::chrono::seconds{2});
  EXPECT_EQ(words(found.lasting),
            "lab/arm0 late; lab/arm0 stopped; lab/arm0 fault; lab/arm0 limit");
  EXPECT_EQ(found.lasting[2].why, "too fast");
  state["not_stopped"] = {{{"device", "lab/arm1"}, {"why", "no answer"}}};
  EXPECT_NE(words(find(state).lasting).find("lab/arm1 not stopped"), std::string::npos);
}

TEST_F(Causes, OfServicesWaitUntilTheConsoleHasAskedThem) {
  Json state = calm();
  state["registry"]["ok"] = false;
  state["hub"]["ok"] = false;
  state["uptime_s"] = 1;
  EXPECT_EQ(words(find(state).lasting), "");
  state["uptime_s"] = 5;
  EXPECT_EQ(words(find(state, std::chrono::seconds{4}).lasting), "");
  EXPECT_EQ(words(find(state, std::chrono::seconds{6}).lasting),
            "registry silent; hub rtpm/events silent");
  state["registry"]["ok"] = true;
  EXPECT_EQ(words(find(state, std::chrono::seconds{7}).lasting), "hub rtpm/events silent");
}

TEST_F(Causes, AreServersOfThisLaboratoryOnly) {
  Json state = calm();
  EXPECT_EQ(words(find(state).lasting), "");
  state["servers"][0]["alive"] = false;
  state["servers"][1]["alive"] = false;
  // Its names have lapsed meanwhile.
  state["objects"] = Json::array();
  EXPECT_EQ(words(find(state).lasting), "rtpm-deviced server lost");
}

TEST_F(Causes, AreChangesOfALease) {
  Json state = calm();
  Json& lease = state["devices"][0]["lease"];
  const auto change = [&](const Json& next) {
    lease = next;
    const auto found = find(state);
    return found.events.empty() ? std::string{} : found.events[0].why;
  };
  EXPECT_EQ(change({{"state", "free"}}), "");
  EXPECT_EQ(change({{"state", "held"}, {"holder", ""}}), "free → another program");
  EXPECT_EQ(change({{"state", "held"}, {"holder", "rtpm-servo on lab"}}), "");
  EXPECT_EQ(change({{"state", "unknown"}}), "");
  EXPECT_EQ(change({{"state", "held by this console"}, {"operator", {{"name", "Anna"}}}}),
            "rtpm-servo on lab → Anna");
  EXPECT_EQ(change({{"state", "free"}}), "Anna → free");
}

TEST_F(Causes, AreDroppedMessagesOfOneRecording) {
  Json state = calm();
  state["recording"] = {{"file", "a.mcap"}, {"drop_count", 0}, {"problem", ""}};
  EXPECT_EQ(words(find(state).events), "");
  state["recording"]["drop_count"] = 7;
  EXPECT_EQ(words(find(state).events), "a.mcap dropped");
  EXPECT_EQ(words(find(state).events), "");
  state["recording"] = {{"file", "b.mcap"}, {"drop_count", 2}, {"problem", "disk full"}};
  const auto found = find(state);
  EXPECT_EQ(words(found.events), "b.mcap dropped");
  EXPECT_EQ(words(found.lasting), "b.mcap recording");
}

TEST_F(Causes, AreLowDisksAndJumpsOfTheClock) {
  disks_ = {{"/data", std::uint64_t{900} << 20}, {"/home", std::uint64_t{5} << 40}};
  auto found = find(calm());
  ASSERT_EQ(words(found.lasting), "disk disk low");
  EXPECT_EQ(found.lasting[0].severity, Severity::kWarning);
  EXPECT_EQ(found.lasting[0].why, "900 MiB are free for /data");
  disks_[0].free_bytes = 0;
  EXPECT_EQ(find(calm(), std::chrono::seconds{1}).lasting[0].severity, Severity::kAlarm);
  set_ns_ = 3'200'000'000;
  found = find(calm(), std::chrono::seconds{2});
  ASSERT_EQ(words(found.events), "clock clock jumped");
  EXPECT_NE(found.events[0].why.find("+3.200 s"), std::string::npos);
  EXPECT_EQ(words(find(calm(), std::chrono::seconds{3}).events), "");
}

TEST_F(Causes, SurviveAnyState) {
  for (const Json& state : {Json(nullptr), Json::array({1}), Json{{"devices", 3}, {"servers", "x"}},
                            Json{{"uptime_s", 9}, {"devices", {1, nullptr, {{"faults", 5}}}}}}) {
    EXPECT_LE(find(state).events.size(), 4U);
  }
}

}  // namespace
}  // namespace rtpm::console
