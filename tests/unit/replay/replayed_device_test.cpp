#include "replayed_device.hpp"

#include <gtest/gtest.h>

#include "recorded_run.hpp"
#include "rtpm/rt/memory.hpp"
#include "rtpm/test/alloc_guard.hpp"

// The samples that a replayed device shows, on the test's own time line.
namespace rtpm::replay {
namespace {

using std::chrono::milliseconds;

constexpr MonotonicTime kBegin = time_from_ns(5'000'000'000);

/// A lever of so many samples that is read in steps.
struct Stepped {
  Stepped(std::size_t count, End end)
      : recorded(lever(count)),
        pace({.length = recorded.times.back(), .loops = end == End::kLoop, .stepped_count = 1}),
        device(recorded, pace, end, nullptr) {}
  RecordedDevice recorded;
  Pace pace;
  ReplayedDevice device;
};

TEST(SteppedDevice, ShowsEachSampleOnceBitByBit) {
  Stepped lever(5, End::kGone);
  for (std::size_t i = 0; i < 5; ++i) {
    EXPECT_FALSE(lever.pace.is_over(kBegin));
    EXPECT_EQ(bytes_of(lever.device.on_read(kBegin)), bytes_of(lever.recorded.samples[i])) << i;
    EXPECT_EQ(lever.pace.position(kBegin).at, lever.recorded.times[i]);
  }
  EXPECT_TRUE(lever.pace.is_over(kBegin));
}

TEST(SteppedDevice, IsGoneAfterTheLastSample) {
  Stepped lever(2, End::kGone);
  for (int i = 0; i < 2; ++i)
    EXPECT_EQ(lever.device.on_read(kBegin).lifecycle(), 2);
  EXPECT_NE(lever.device.active(kBegin), nullptr);
  const device::Sample last = lever.device.on_read(kBegin);
  EXPECT_EQ(last.sequence(), 101u);
  EXPECT_EQ(last.lifecycle(), static_cast<std::uint8_t>(driver::Lifecycle::kFault));
  EXPECT_TRUE(driver::Faults{last.faults()}.has(driver::Fault::kDeviceGone));
  EXPECT_EQ(lever.device.active(kBegin), nullptr);
}

TEST(SteppedDevice, HoldsTheLastSampleOrLoops) {
  Stepped holding(2, End::kHold);
  Stepped looping(2, End::kLoop);
  for (int i = 0; i < 2; ++i) {
    static_cast<void>(holding.device.on_read(kBegin));
    static_cast<void>(looping.device.on_read(kBegin));
  }
  EXPECT_EQ(bytes_of(holding.device.on_read(kBegin)), bytes_of(holding.recorded.samples[1]));
  EXPECT_EQ(bytes_of(looping.device.on_read(kBegin)), bytes_of(looping.recorded.samples[0]));
  EXPECT_EQ(looping.pace.position(kBegin).round, 1u);
}

TEST(PacedDevice, ShowsTheSampleOfThePresentTime) {
  const RecordedDevice recorded = lever(10);
  Pace pace({.length = milliseconds{9}});
  ReplayedDevice device(recorded, pace, End::kGone, nullptr);
  pace.play(kBegin, 1);
  EXPECT_EQ(device.on_read(kBegin).sequence(), 100u);
  for (int i = 0; i < 2; ++i)
    EXPECT_EQ(device.on_read(kBegin + Duration{4'900'000}).sequence(), 104u);
  EXPECT_EQ(device.on_read(kBegin + milliseconds{50}).sequence(), 109u);
  EXPECT_EQ(device.active(kBegin + milliseconds{50}), nullptr);
}

TEST(PacedDevice, HasNoSampleBeforeItsFirst) {
  RecordedDevice recorded = lever(2);
  recorded.times = {milliseconds{5}, milliseconds{6}};
  Pace pace({.length = milliseconds{9}});
  ReplayedDevice device(recorded, pace, End::kGone, nullptr);
  pace.play(kBegin, 1);
  EXPECT_EQ(device.on_read(kBegin + milliseconds{4}).sequence(), 0u);
  EXPECT_EQ(device.active(kBegin + milliseconds{4}), nullptr);
  EXPECT_EQ(device.on_read(kBegin + milliseconds{5}).sequence(), 100u);
  EXPECT_NE(device.active(kBegin + milliseconds{5}), nullptr);
}

TEST(ReplayedDeviceTest, IsReadAndCommandedWithoutAllocation) {
  Stepped stepped(3, End::kGone);
  Pace pace({.length = milliseconds{2}});
  ReplayedDevice paced(stepped.recorded, pace, End::kGone, nullptr);
  pace.play(kBegin, 1);
  const rt::NoAllocationScope no_allocation;
  EXPECT_EQ(stepped.device.on_read(kBegin).sequence(), 100u);
  EXPECT_EQ(paced.on_read(kBegin).sequence(), 100u);
  stepped.device.on_command({}, gvd::DeviceOutcome::kDone, kBegin);
  stepped.device.on_command({}, gvd::DeviceOutcome::kNotActive, kBegin);
  EXPECT_EQ(stepped.device.counters().command_count, 1u);
  EXPECT_EQ(stepped.device.counters().refused_count, 1u);
}

}  // namespace
}  // namespace rtpm::replay
