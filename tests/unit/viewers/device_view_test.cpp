#include "rtpm/viewers/device_view.hpp"

#include <gtest/gtest.h>

#include <map>

namespace rtpm::viewers {
namespace {

driver::Descriptor tracker() {
  driver::Descriptor descriptor;
  descriptor.axes.push_back({.name = "x"});
  return descriptor;
}

driver::Descriptor arm() {
  driver::Descriptor descriptor = tracker();
  descriptor.limits.force_newton_max = 10;
  return descriptor;
}

std::vector<std::string> topics_of(const DeviceView& view) {
  std::vector<std::string> topics;
  for (const Channel& channel : view.channels())
    topics.push_back(channel.topic);
  return topics;
}

TEST(DeviceView, HasTheChannelsOfItsDevice) {
  EXPECT_EQ(topics_of({"lab/arm0", arm()}),
            (std::vector<std::string>{"lab/arm0/pose", "rtpm/tf", "lab/arm0/force"}));
  EXPECT_EQ(topics_of({"lab/tracker0", tracker()}),
            (std::vector<std::string>{"lab/tracker0/pose", "rtpm/tf"}));
  EXPECT_EQ(topics_of({"lab/pedal0", driver::Descriptor{}}), std::vector<std::string>{});
}

TEST(DeviceView, KeepsTheRatesOfItsChannels) {
  DeviceView view("lab/arm0", arm());
  std::map<std::string, int> counts;
  for (std::uint64_t ms = 1'000; ms < 3'000; ++ms) {
    for (const auto& due : view.take({}, ms * 1'000'000))
      ++counts[view.channels()[due.channel].topic];
  }
  EXPECT_EQ(counts["lab/arm0/pose"], 200);
  EXPECT_EQ(counts["rtpm/tf"], 200);
  EXPECT_NEAR(counts["lab/arm0/force"], 60, 1);
}

}  // namespace
}  // namespace rtpm::viewers
