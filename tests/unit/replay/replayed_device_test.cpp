#include "rtpm/replay/replayed_device.hpp"

#include <gtest/gtest.h>

#include "recorded_run.hpp"
#include "rtpm/rt/memory.hpp"
#include "rtpm/test/alloc_guard.hpp"

// A replayed device's methods, on the test's own time line.
namespace rtpm::replay {
namespace {

using std::chrono::milliseconds;

constexpr MonotonicTime kBegin = time_from_ns(5'000'000'000);

rpc::CallContext at(Duration since_begin) {
  return {.priority = 100, .deadline = kNever, .received = kBegin + since_begin};
}

class Commands final : public CommandSink {
 public:
  void take(const device::Command& command, std::uint64_t sample_sequence) noexcept override {
    forces[count % 8] = command.force_newton().x();
    sequences[count++ % 8] = sample_sequence;
  }
  double forces[8] = {};
  std::uint64_t sequences[8] = {};
  std::size_t count = 0;
};

device::Command force(std::uint64_t lease, std::uint32_t sequence, double newton) {
  gvd::ClientCommand command{lease, sequence, milliseconds{10},
                             driver::Setpoint::with_wrench({{newton, 0, 0}, {}})};
  return gvd::to_wire(command);
}

TEST(SteppedDevice, ShowsEachSampleOnceBitByBit) {
  const RecordedDevice recorded = lever(5);
  ReplayedDevice device(recorded, {});
  for (std::size_t i = 0; i < 5; ++i) {
    EXPECT_FALSE(device.is_stepped_through());
    const auto sample = device.read(at({}));
    ASSERT_TRUE(sample);
    EXPECT_EQ(bytes_of(*sample), bytes_of(recorded.samples[i])) << i;
  }
  EXPECT_TRUE(device.is_stepped_through());
}

TEST(SteppedDevice, IsGoneBehindTheLastSample) {
  const RecordedDevice recorded = lever(2);
  ReplayedDevice device(recorded, {});
  for (int i = 0; i < 2; ++i)
    EXPECT_EQ(device.read(at({}))->lifecycle(), 2);
  const auto last = device.read(at({}));
  EXPECT_EQ(last->sequence(), 101u);
  EXPECT_EQ(last->lifecycle(), static_cast<std::uint8_t>(driver::Lifecycle::kFault));
  EXPECT_TRUE(driver::Faults{last->faults()}.has(driver::Fault::kDeviceGone));
}

TEST(SteppedDevice, LosesItsHolderWhenItIsGone) {
  const RecordedDevice recorded = lever(1);
  ReplayedDevice device(recorded, {.lease_key = {1, 2}});
  const auto lease = device.acquire(at({}));
  ASSERT_EQ(lease->outcome(), device::OutcomeCode::Done);
  for (int i = 0; i < 2; ++i)
    static_cast<void>(device.read(at({})));
  EXPECT_EQ(device.command(force(lease->id(), 1, 1), at({}))->code(),
            device::OutcomeCode::NotActive);
  device.attend(kBegin);
  EXPECT_EQ(device.command(force(lease->id(), 2, 1), at({}))->code(),
            device::OutcomeCode::NotHolder);
  EXPECT_EQ(device.lease_state(device::Holder{lease->id()}, at({}))->state(),
            static_cast<std::uint8_t>(gvd::LeaseState::kDeviceLost));
}

TEST(SteppedDevice, HoldsOrLoopsWhereItShall) {
  const RecordedDevice recorded = lever(2);
  ReplayedDevice holding(recorded, {.end = End::kHold});
  ReplayedDevice looping(recorded, {.end = End::kLoop});
  for (int i = 0; i < 2; ++i) {
    static_cast<void>(holding.read(at({})));
    static_cast<void>(looping.read(at({})));
  }
  EXPECT_EQ(bytes_of(*holding.read(at({}))), bytes_of(recorded.samples[1]));
  EXPECT_EQ(bytes_of(*looping.read(at({}))), bytes_of(recorded.samples[0]));
}

TEST(SteppedDevice, HandsOutCommandsWithTheSampleThatItShows) {
  const RecordedDevice recorded = lever(3);
  Commands commands;
  ReplayedDevice device(recorded, {.lease_key = {1, 2}, .commands = &commands});
  const auto lease = device.acquire(at({}));
  for (std::uint32_t i = 1; i <= 3; ++i) {
    static_cast<void>(device.read(at({})));
    EXPECT_EQ(device.command(force(lease->id(), i, 0.5 * i), at({}))->code(),
              device::OutcomeCode::Done);
  }
  ASSERT_EQ(commands.count, 3u);
  EXPECT_EQ(commands.sequences[0], 100u);
  EXPECT_EQ(commands.sequences[2], 102u);
  EXPECT_EQ(commands.forces[2], 1.5);
  EXPECT_EQ(device.counters().command_count, 3u);
}

TEST(PacedDevice, ShowsTheSampleOfThePresentTime) {
  const RecordedDevice recorded = lever(10);
  Pace pace(milliseconds{9}, 1, false);
  ReplayedDevice device(recorded, {.pace = &pace});
  pace.start(kBegin);
  EXPECT_EQ(device.read(at(milliseconds{0}))->sequence(), 100u);
  EXPECT_EQ(device.read(at(Duration{4'900'000}))->sequence(), 104u);
  EXPECT_EQ(device.read(at(Duration{4'900'000}))->sequence(), 104u);
  EXPECT_EQ(device.read(at(milliseconds{50}))->sequence(), 109u);
}

TEST(PacedDevice, HasNoSampleBeforeItsFirst) {
  RecordedDevice recorded = lever(2);
  recorded.times = {milliseconds{5}, milliseconds{6}};
  Pace pace(milliseconds{9}, 1, false);
  ReplayedDevice device(recorded, {.pace = &pace});
  pace.start(kBegin);
  EXPECT_EQ(device.read(at(milliseconds{4}))->sequence(), 0u);
  EXPECT_EQ(device.read(at(milliseconds{5}))->sequence(), 100u);
}

TEST(ReplayedDeviceTest, TakesNoCommandWhileTheRecordedOneWasNotActive) {
  RecordedDevice recorded = lever(1);
  driver::Sample inactive = gvd::from_wire(recorded.samples[0]);
  inactive.lifecycle = driver::Lifecycle::kInactive;
  recorded.samples[0] = gvd::to_wire(inactive);
  ReplayedDevice device(recorded, {.lease_key = {1, 2}});
  const auto lease = device.acquire(at({}));
  EXPECT_EQ(device.command(force(lease->id(), 1, 1), at({}))->code(),
            device::OutcomeCode::NotActive);
  EXPECT_EQ(device.counters().refused_count, 1u);
}

TEST(ReplayedDeviceTest, ReadsAndCommandsWithoutAllocation) {
  const RecordedDevice recorded = lever(3);
  Commands commands;
  Pace pace(milliseconds{2}, 1, false);
  ReplayedDevice stepped(recorded, {.lease_key = {1, 2}, .commands = &commands});
  ReplayedDevice paced(recorded, {.pace = &pace});
  const auto lease = stepped.acquire(at({}));
  pace.start(kBegin);
  const rt::NoAllocationScope no_allocation;
  EXPECT_TRUE(stepped.read(at({})).has_value());
  EXPECT_TRUE(paced.read(at({})).has_value());
  EXPECT_TRUE(stepped.command(force(lease->id(), 1, 1), at({})).has_value());
  stepped.attend(kBegin);
}

}  // namespace
}  // namespace rtpm::replay
