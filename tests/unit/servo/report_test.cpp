#include "report.hpp"

#include <gtest/gtest.h>

#include <memory>
#include <string>

namespace rtpm::servo {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;

bool has(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

TEST(LiveText, ShowsPositionForceContactAndLatency) {
  Live live;
  live.sample.pose.position_m = {0.0123, 0, -0.0045};
  live.force_newton = {0, 0, 2.7};
  live.depth_m = 0.0045;
  const auto cycles = std::make_unique<LatencyHistogram>();
  for (int i = 0; i < 100; ++i)
    cycles->record(microseconds{40});
  const std::string text = live_text(live, *cycles, milliseconds{2500});
  EXPECT_TRUE(has(text, "2.5 s")) << text;
  EXPECT_TRUE(has(text, "+12.3")) << text;
  EXPECT_TRUE(has(text, "-4.5 mm")) << text;
  EXPECT_TRUE(has(text, "2.70 N")) << text;
  EXPECT_TRUE(has(text, "contact")) << text;
  EXPECT_TRUE(has(text, "p50  40.0 us")) << text;
  EXPECT_FALSE(has(text, "failed")) << text;
  live.depth_m = 0;
  live.failed_count = 3;
  live.sample.faults.set(driver::Fault::kSoftStart);
  const std::string troubled = live_text(live, *cycles, milliseconds{2500});
  EXPECT_TRUE(has(troubled, "free")) << troubled;
  EXPECT_TRUE(has(troubled, "failed calls 3")) << troubled;
  EXPECT_TRUE(has(troubled, "soft start")) << troubled;
}

TEST(TableText, HasARowForEachMeasureAndThePapersFigures) {
  const auto statistics = std::make_unique<Statistics>();
  for (int i = 0; i < 1000; ++i) {
    statistics->read.record(microseconds{10});
    statistics->command.record(microseconds{10});
    statistics->cycle.record(microseconds{20});
  }
  statistics->cycle.record(milliseconds{7});
  statistics->cycle_count = 1001;
  statistics->missed_count = 2;
  statistics->call_count = 2002;
  statistics->call_within_paper_count = 1001;
  statistics->cycle_within_paper_count = 1000;
  const std::string text = table_text(*statistics);
  for (const char* part :
       {"p50", "p99.99", "one call: read", "one call: command", "one cycle of two calls",
        "begun late by", "7000.0", "cycles 1001   missed deadlines 2   failed calls 0",
        "50.0 % of calls within 58 us", "99.90 % of whole cycles within 1 ms", "110 us",
        "200 us"}) {
    EXPECT_TRUE(has(text, part)) << part << " is not in\n" << text;
  }
}

TEST(FeelText, SaysHowTheWallWasRenderedAndFelt) {
  LoopConfig config;
  config.wall.stiffness_newton_per_m = 600;
  config.delay = milliseconds{20};
  Feel feel;
  EXPECT_EQ(feel_text(feel, config),
            "  the plane of 600 N/m, rendered by this program with 20.0 ms of delay each way: not "
            "touched\n");
  driver::Sample sample;
  sample.pose.position_m.z = -0.004;
  sample.wrench_applied.force_newton.z = 1.2;
  feel.record({.device_m = {0, 0, -0.004}, .proxy_m = {}, .depth_m = 0.004}, sample);
  config.is_local = true;
  EXPECT_EQ(feel_text(feel, config),
            "  the plane of 600 N/m, rendered in the device's loop: felt as 300 N/m, entered by "
            "4.00 mm at most\n");
}

TEST(TableText, HasFiniteNumbersWithoutCycles) {
  const auto statistics = std::make_unique<Statistics>();
  const std::string text = table_text(*statistics);
  EXPECT_FALSE(has(text, "nan")) << text;
  EXPECT_TRUE(has(text, "cycles 0")) << text;
}

}  // namespace
}  // namespace rtpm::servo
