#include "rtpm/viewers/device_view.hpp"

#include <gtest/gtest.h>

#include <map>
#include <vector>

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

/// The size of the scene at `time_ns`, which grows with each shape.
std::size_t scene_size(DeviceView& view, std::uint64_t time_ns) {
  for (const DeviceView::Due& due : view.take({}, time_ns)) {
    if (view.channels()[due.channel].topic == "lab/arm0/force") return due.message.size();
  }
  ADD_FAILURE() << "no scene";
  return 0;
}

TEST(DeviceView, DrawsModelsUntilTheyEndOrAreNotRepeated) {
  constexpr std::uint64_t kSecondNs = 1'000'000'000;
  const gvd::ModelList wall{std::vector<gvd::Model>{gvd::Plane{{}, {0, 0, 1}, 100, 0}}};
  DeviceView view("lab/arm0", arm());
  const std::size_t empty = scene_size(view, kSecondNs);
  view.set_models(wall, kSecondNs);
  EXPECT_GT(scene_size(view, 2 * kSecondNs), empty);
  EXPECT_GT(scene_size(view, 4 * kSecondNs - 1), empty);
  EXPECT_EQ(scene_size(view, 5 * kSecondNs), empty) << "not repeated";
  view.set_models(wall, 6 * kSecondNs);
  EXPECT_GT(scene_size(view, 6 * kSecondNs), empty);
  view.set_models({}, 7 * kSecondNs);
  EXPECT_EQ(scene_size(view, 7 * kSecondNs), empty) << "ended";
}

}  // namespace
}  // namespace rtpm::viewers
