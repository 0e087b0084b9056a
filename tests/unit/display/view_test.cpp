#include "view.hpp"

#include <gtest/gtest.h>

#include <array>

namespace rtpm::display {
namespace {

driver::Descriptor sensor() {
  driver::Descriptor descriptor;
  descriptor.analogs = {{.name = "level", .unit = "1"}};
  return descriptor;
}

gvd::DeviceEvent sample(std::uint64_t sequence, float level) {
  driver::Sample sample;
  sample.sequence = sequence;
  sample.analogs[0] = level;
  sample.lifecycle = driver::Lifecycle::kActive;
  gvd::DeviceEvent event;
  event.what = sample;
  return event;
}

template <class What>
gvd::DeviceEvent event_of(const What& what) {
  gvd::DeviceEvent event;
  event.what = what;
  return event;
}

void show(View& view, const gvd::DeviceEvent& event) {
  view.on_events(std::span(&event, 1));
}

TEST(ViewOfADevice, SaysThatNothingCameYet) {
  const View view("lab/sensor", sensor(), 4);
  EXPECT_EQ(view.line(12, 30), "lab/sensor    nothing yet     ");
}

TEST(ViewOfADevice, ShowsTheNewestSampleAndTheCurve) {
  View view("lab/sensor", sensor(), 2);
  show(view, sample(1, 0.9F));
  show(view, sample(101, 0.25F));
  show(view, sample(201, 0.75F));
  const std::string line = view.line(12, 80);
  EXPECT_NE(line.find("level 0.75"), std::string::npos);
  EXPECT_NE(line.find("▁█"), std::string::npos);
  EXPECT_EQ(view.sight().sample_count, 3u);
  EXPECT_EQ(view.sight().cycle_count, 201u);
}

TEST(ViewOfADevice, MarksSilenceAndStopsAndALostHub) {
  View view("lab/sensor", sensor(), 2);
  show(view, sample(1, 0));
  show(view, event_of(gvd::Timeout{}));
  EXPECT_NE(view.line(12, 80).find("silent"), std::string::npos);
  auto stopped = sample(2, 0);
  std::get<driver::Sample>(stopped.what).faults.set(driver::Fault::kEmergencyStop);
  show(view, stopped);
  EXPECT_NE(view.line(12, 80).find("stopped"), std::string::npos);
  view.on_notice({.kind = events::NoticeKind::kInterrupted});
  EXPECT_NE(view.line(12, 80).find("no hub"), std::string::npos);
  EXPECT_EQ(view.sight().gap_count, 1u);
}

TEST(ViewOfADevice, CountsChanges) {
  View view("lab/sensor", sensor(), 2);
  show(view, event_of(gvd::ButtonChange{0, true}));
  show(view, event_of(gvd::ButtonChange{0, false}));
  show(view, event_of(gvd::ContactChange{true, 1}));
  show(view, event_of(gvd::LeaseChange{gvd::LeaseState::kHeld}));
  show(view, event_of(gvd::StopChange{true}));
  EXPECT_EQ(view.sight().press_count, 1u);
  EXPECT_EQ(view.sight().contact_count, 1u);
  EXPECT_EQ(view.sight().lease_count, 1u);
  EXPECT_EQ(view.sight().other_count, 1u);
}

}  // namespace
}  // namespace rtpm::display
