#include "rtpm/gvd/consumer.hpp"

#include <gtest/gtest.h>

#include <array>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "cycle.hpp"
#include "events/event_wire.hpp"
#include "rtpm/base/latest.hpp"
#include "rtpm/events/supplier.hpp"
#include "rtpm/gvd/publisher.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/test/alloc_guard.hpp"
#include "scripted_driver.hpp"
#include "served_hub.hpp"

/// Devices that produce scripted cycles, a hub, and its consumers.
namespace rtpm::gvd {
namespace {

using namespace std::chrono_literals;
using events::NoticeKind;
using events::test::await;
using events::test::kPatience;
using events::test::ServedHub;

const std::string kArm = "lab/arm0";
const std::string kGaze = "lab/gaze0";

/// Writes down one line per delivery, such as "arm0 pressed 0 + gaze0 sample 3".
class Listener final : public DeviceEventHandler {
 public:
  void on_events(std::span<const DeviceEvent> events) override {
    std::string line;
    for (const DeviceEvent& event : events)
      line += (line.empty() ? "" : " + ") + text_of(event);
    const std::lock_guard lock(mutex_);
    lines_.push_back(line);
    changed_.notify_all();
  }
  void on_notice(const events::Notice& notice) override {
    const std::lock_guard lock(mutex_);
    notices_.push_back(notice);
    changed_.notify_all();
  }
  [[nodiscard]] std::vector<std::string> lines() {
    const std::lock_guard lock(mutex_);
    return lines_;
  }
  /// Waits until there are `count` lines, and returns them.
  [[nodiscard]] std::vector<std::string> await_lines(std::size_t count) {
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, kPatience, [&] { return lines_.size() >= count; });
    return lines_;
  }
  [[nodiscard]] std::optional<events::Notice> await_notice(NoticeKind kind) {
    std::unique_lock lock(mutex_);
    std::optional<events::Notice> found;
    changed_.wait_for(lock, kPatience, [&] {
      for (const events::Notice& notice : notices_) {
        if (notice.kind == kind) found = notice;
      }
      return found.has_value();
    });
    return found;
  }

 private:
  static std::string text_of(const DeviceEvent& event) {
    if (const auto* timeout = std::get_if<Timeout>(&event.what)) {
      return "silence " + std::to_string(timeout->tag);
    }
    std::string text(event.device.substr(event.device.find('/') + 1));
    if (std::holds_alternative<driver::Sample>(event.what)) {
      text += " sample " + std::to_string(event.cycle);
    } else if (const auto* button = std::get_if<ButtonChange>(&event.what)) {
      text += (button->is_pressed ? " pressed " : " released ") + std::to_string(button->button);
    } else if (const auto* lease = std::get_if<LeaseChange>(&event.what)) {
      text += " lease " + std::to_string(static_cast<int>(lease->state));
    } else if (const auto* configuration = std::get_if<ConfigurationChange>(&event.what)) {
      text += " revision " + std::to_string(configuration->revision) + " of " +
              configuration->names.front();
    } else if (const auto* models = std::get_if<ModelsChange>(&event.what)) {
      for (const Model& model : models->models)
        text += ' ' + std::string(to_string(model));
      text += " since " + std::to_string(event.cycle);
    } else {
      text += " change";
    }
    return text;
  }

  std::mutex mutex_{};
  std::condition_variable changed_{};
  std::vector<std::string> lines_{};
  std::vector<events::Notice> notices_{};
};

/// A device whose cycles a test scripts.
class ScriptedDevice {
 public:
  explicit ScriptedDevice(CycleObserver& observer) : observer_(observer) {
    record_.sample.lifecycle = driver::Lifecycle::kActive;
  }
  void cycle(MonotonicTime time) {
    record_.time = time;
    ++record_.sample.sequence;
    observer_.on_cycle(record_);
  }
  void turn_button(std::size_t button) {
    record_.sample.buttons ^= 1U << button;
    ++record_.sample.button_edges[button];
  }
  void render(const std::vector<Model>& models) {
    observer_.on_models({rt::now(), record_.sample.sequence, ModelList{models}});
  }
  CycleRecord& record() noexcept { return record_; }

 private:
  CycleObserver& observer_;
  CycleRecord record_{};
};

class DeviceEvents : public ::testing::Test {
 protected:
  DeviceEvents() {
    DevicePublisherConfig config;
    config.hub = hub_.url();
    config.retry = 10ms;
    config.thread.realtime = rt::RealtimeMode::kOff;
    publisher_ = std::make_unique<DevicePublisher>(node_, config);
    arm_ = std::make_unique<ScriptedDevice>(**publisher_->add(kArm));
    gaze_ = std::make_unique<ScriptedDevice>(**publisher_->add(kGaze));
    EXPECT_TRUE(publisher_->start());
    // From here on the device reports changes.
    arm_->cycle(start_);
    gaze_->cycle(start_);
    EXPECT_TRUE(await([&] { return pushed() >= 4; }));
    EXPECT_TRUE(await([&] { return hub_.hub().intake().taken_count >= 4; }));
  }
  [[nodiscard]] std::uint64_t pushed() const { return publisher_->counters().pushed_count; }
  /// Waits until the hub has taken `count` further events.
  template <class Act>
  void push_and_await(std::uint64_t count, Act act) {
    const std::uint64_t before = hub_.hub().intake().taken_count;
    act();
    EXPECT_TRUE(await([&] { return hub_.hub().intake().taken_count >= before + count; }));
  }
  DeviceConsumer subscribe(DeviceEventHandler& handler, events::Filter filter = {},
                           events::DeliveryPolicy delivery = {}) {
    DeviceConsumerConfig config{.hub = hub_.url(), .devices = {kArm, kGaze}};
    config.subscription.filter = std::move(filter);
    config.subscription.delivery = std::move(delivery);
    config.subscription.realtime = rt::RealtimeMode::kOff;
    config.subscription.deadline = kPatience;
    auto consumer = DeviceConsumer::start(node_, config, handler);
    RTPM_ASSERT(consumer.has_value(), "subscribes");
    return std::move(*consumer);
  }

  rpc::Node node_{};
  ServedHub hub_{};
  const MonotonicTime start_ = rt::now();
  std::unique_ptr<DevicePublisher> publisher_{};
  std::unique_ptr<ScriptedDevice> arm_{};
  std::unique_ptr<ScriptedDevice> gaze_{};
};

TEST_F(DeviceEvents, AreSamplesAndChangesInTheOrderOfTheirCycles) {
  Listener listener;
  const auto consumer = subscribe(listener, events::any_of({samples_of(kArm), changes_of(kArm)}));
  arm_->cycle(start_ + 1ms);
  arm_->turn_button(1);
  arm_->record().is_held = true;
  arm_->cycle(start_ + 2ms);
  gaze_->cycle(start_ + 2ms);
  EXPECT_EQ(listener.await_lines(4), (std::vector<std::string>{"arm0 sample 2", "arm0 sample 3",
                                                               "arm0 lease 1", "arm0 pressed 1"}));
}

TEST_F(DeviceEvents, KeepEveryValueOfASample) {
  class Keeper final : public SampleSink {
   public:
    void push(const driver::Sample& sample) override { newest.write(sample); }
    Latest<driver::Sample> newest{};
  } keeper;
  DeviceConsumerConfig config{.hub = hub_.url()};
  config.subscription.realtime = rt::RealtimeMode::kOff;
  auto consumer = DeviceConsumer::start(node_, kArm, config, keeper);
  ASSERT_TRUE(consumer) << consumer.error().text();
  driver::Sample& sample = arm_->record().sample;
  sample.pose.position_m = {0.1, 0.2, 0.3};
  sample.joints[7] = 7;
  sample.analogs[3] = 0.25F;
  arm_->cycle(start_ + 1ms);
  gaze_->cycle(start_ + 1ms);
  ASSERT_TRUE(await([&] { return keeper.newest.read().has_value(); }));
  EXPECT_EQ(keeper.newest.read()->pose.position_m, sample.pose.position_m);
  EXPECT_EQ(keeper.newest.read()->joints, sample.joints);
  EXPECT_EQ(keeper.newest.read()->analogs, sample.analogs);
}

TEST_F(DeviceEvents, CarryTheTimeOfMeasurement) {
  class Origins final : public events::EventHandler {
   public:
    void on_events(std::span<const events::EventView> events) override {
      const std::lock_guard lock(mutex_);
      for (const events::EventView& event : events)
        origins_.push_back(event.header.origin);
    }
    [[nodiscard]] std::vector<MonotonicTime> origins() {
      const std::lock_guard lock(mutex_);
      return origins_;
    }

   private:
    std::mutex mutex_{};
    std::vector<MonotonicTime> origins_{};
  } handler;
  auto consumer = events::Consumer::create(node_, hub_.url(),
                                           {.filter = samples_of(kGaze),
                                            .realtime = rt::RealtimeMode::kOff,
                                            .types = device_event_types(),
                                            .deadline = kPatience},
                                           handler);
  ASSERT_TRUE(consumer) << consumer.error().text();
  driver::Sample& sample = gaze_->record().sample;
  const auto cycle = [&](MonotonicTime now, MonotonicTime measured, driver::Faults faults = {}) {
    sample.host_time = measured;
    sample.faults = faults;
    gaze_->cycle(now);
  };
  cycle(start_ + 20ms, start_ + 12ms);
  cycle(start_ + 21ms, {});
  cycle(start_ + 22ms, start_ + 22ms - 5s);
  cycle(start_ + 23ms, start_ + 9ms, driver::Faults{1U << 19});
  ASSERT_TRUE(await([&] { return handler.origins().size() == 4; }));
  // The device and the hub read the same clock.
  const std::vector<MonotonicTime> origins = handler.origins();
  const auto near = [&](std::size_t i, Duration time) {
    return std::chrono::abs(origins[i] - (start_ + time)) < 1ms;
  };
  EXPECT_TRUE(near(0, 12ms)) << "a tracker's latency";
  EXPECT_TRUE(near(1, 21ms)) << "no time";
  EXPECT_TRUE(near(2, 22ms)) << "it has reported no change for 5 s";
  EXPECT_TRUE(near(3, 23ms)) << "a time that can't be";
}

TEST_F(DeviceEvents, AreCorrelatedBetweenTwoDevicesAndReportSilence) {
  Listener listener;
  const auto consumer = subscribe(
      listener, events::any_of({events::correlate({pressed(kArm, 0), samples_of(kGaze)}, 5ms),
                                events::silence(300ms, /*tag=*/9)}));
  const auto press_at = [&](Duration time) {
    push_and_await(2, [&] {
      arm_->turn_button(0);
      arm_->cycle(start_ + time);
    });
  };
  const auto look_at = [&](Duration time) {
    push_and_await(1, [&] { gaze_->cycle(start_ + time); });
  };
  press_at(100ms);  // Pressed; a gaze sample follows 3 ms later.
  look_at(103ms);
  press_at(150ms);  // A release, which the filter does not accept.
  press_at(200ms);  // Gaze samples: 8 ms later, and 4 ms before the next press.
  look_at(208ms);
  press_at(300ms);  // Released.
  look_at(396ms);
  press_at(400ms);
  const auto lines = listener.await_lines(3);
  ASSERT_GE(lines.size(), 3u);
  EXPECT_EQ(lines[0], "arm0 pressed 0 + gaze0 sample 2");
  EXPECT_EQ(lines[1], "arm0 pressed 0 + gaze0 sample 4");
  EXPECT_EQ(lines[2], "silence 9");
}

// A sample that completes a pair is delivered in it, although samples are also wanted alone.
TEST_F(DeviceEvents, ComeAloneAndCorrelatedToOneConsumer) {
  Listener listener;
  const auto consumer = subscribe(
      listener, events::any_of({samples_of(kGaze),
                                events::correlate({pressed(kArm, 0), samples_of(kGaze)}, 5ms)}));
  const auto look_at = [&](Duration time) {
    push_and_await(1, [&] { gaze_->cycle(start_ + time); });
  };
  look_at(50ms);
  push_and_await(2, [&] {
    arm_->turn_button(0);
    arm_->cycle(start_ + 100ms);
  });
  look_at(103ms);
  look_at(150ms);
  EXPECT_EQ(listener.await_lines(3),
            (std::vector<std::string>{"gaze0 sample 2", "arm0 pressed 0 + gaze0 sample 3",
                                      "gaze0 sample 4"}));
}

TEST_F(DeviceEvents, AreLatchedForLateConsumers) {
  push_and_await(2, [&] {
    arm_->record().is_held = true;
    arm_->cycle(start_ + 1ms);
  });
  Listener listener;
  const auto consumer =
      subscribe(listener, events::of_type(kLeaseChanged, source_of(kArm)), {.replay = 1});
  EXPECT_EQ(listener.await_lines(1), std::vector<std::string>{"arm0 lease 1"});
}

TEST_F(DeviceEvents, ReportChangesOfTheConfiguration) {
  Listener listener;
  const auto consumer = subscribe(listener, changes_of(kGaze));
  const std::vector<std::string> names{"optics.gain"};
  publisher_->publish_configuration(kGaze, 42, names);
  EXPECT_EQ(listener.await_lines(1), std::vector<std::string>{"gaze0 revision 42 of optics.gain"});
}

TEST_F(DeviceEvents, RepeatTheModelsThatADeviceRenders) {
  Listener listener;
  const auto consumer = subscribe(listener, events::of_type(kModelsRendered));
  arm_->render({Plane{{}, {0, 0, 1}, 400, 0}, Friction{0, 0, 0.1}});
  EXPECT_EQ(listener.await_lines(2), (std::vector<std::string>{"arm0 plane friction since 1",
                                                               "arm0 plane friction since 1"}));
  arm_->render({});
  EXPECT_EQ(listener.await_lines(3).back(), "arm0 since 1");
}

TEST_F(DeviceEvents, PushAtMostThirtyListsOfModelsPerSecond) {
  Listener listener;
  const auto consumer = subscribe(listener, events::of_type(kModelsRendered));
  const MonotonicTime begin = rt::now();
  for (int i = 1; i <= 100; ++i) {
    arm_->render({Plane{{}, {0, 0, 1}, 4.0 * i, 0}});
    rt::sleep_until(rt::now() + 1ms);
  }
  arm_->render({Sphere{.radius_m = 0.1}});
  EXPECT_TRUE(await([&] {
    const auto lines = listener.lines();
    return !lines.empty() && lines.back() == "arm0 sphere since 1";
  }));
  EXPECT_LE(listener.lines().size(), 2u + static_cast<std::size_t>((rt::now() - begin) / 33ms));
}

TEST_F(DeviceEvents, ContinueWhenTheHubIsBackAndReportTheGap) {
  Listener listener;
  const auto consumer = subscribe(listener, changes_of(kArm));
  hub_.stop();
  ASSERT_TRUE(listener.await_notice(NoticeKind::kInterrupted));
  arm_->turn_button(0);
  arm_->cycle(start_ + 1ms);
  hub_.start();
  const auto back = listener.await_notice(NoticeKind::kResubscribed);
  ASSERT_TRUE(back);
  EXPECT_TRUE(back->has_hub_restarted);
  EXPECT_GT(back->gap, Duration{0});
  EXPECT_TRUE(await([&] {
    arm_->turn_button(1);
    arm_->cycle(rt::now());
    std::this_thread::sleep_for(1ms);
    return !listener.lines().empty();
  }));
}

TEST_F(DeviceEvents, AreCountedAndOmittedIfOfAnUnknownVersion) {
  Listener listener;
  const auto consumer = subscribe(listener, changes_of(kArm));
  auto supplier = events::Supplier::create(node_, hub_.url());
  ASSERT_TRUE(supplier) << supplier.error().text();
  const std::array<std::byte, 3> payload{};
  ASSERT_TRUE((*supplier)->push(
      {.type = kLeaseChanged, .source = source_of(kArm), .schema_id = 1, .payload = payload}));
  EXPECT_TRUE(await([&] { return consumer.unreadable_count() == 1; }));
  EXPECT_TRUE(listener.lines().empty());
}

TEST(DevicePublisher, RefusesTwoDevicesOfOneName) {
  rpc::Node node;
  DevicePublisher publisher(node, {});
  ASSERT_TRUE(publisher.add(kArm));
  const auto again = publisher.add(kArm);
  ASSERT_FALSE(again);
  EXPECT_NE(again.error().text().find("rename one of them"), std::string::npos);
}

/// Without a hub, cycles go on without waiting or allocating.
TEST(DevicePublisher, NeverBlocksADevice) {
  rpc::Node node;
  DevicePublisherConfig config;
  config.hub = "rtpm://127.0.0.1:9/rtpm/events";
  config.thread.realtime = rt::RealtimeMode::kOff;
  DevicePublisher publisher(node, config);
  test::ScriptedDriver driver;
  CycleConfig cycle_config;
  cycle_config.observer = *publisher.add(kArm);
  DeviceCycle cycle(driver, cycle_config, {1, 2});
  ASSERT_TRUE(publisher.start());
  MonotonicTime now = rt::now();
  ASSERT_TRUE(cycle.begin(now));
  const std::uint64_t allocated = test::thread_allocation_count();
  for (int i = 0; i < 5000; ++i)
    cycle.run(now += 1ms, 0);
  EXPECT_EQ(test::thread_allocation_count(), allocated);
  EXPECT_EQ(cycle.counters().cycle_count, 5000u);
  EXPECT_EQ(cycle.counters().missed_count, 0u);
  EXPECT_TRUE(await([&] {
    const auto counters = publisher.counters();
    return counters.no_hub_count + counters.overrun_count == 5000;
  }));
}

TEST(DeviceConsumer, NeedsDevicesOrAFilter) {
  rpc::Node node;
  Listener listener;
  const auto consumer = DeviceConsumer::start(node, DeviceConsumerConfig{}, listener);
  ASSERT_FALSE(consumer);
  EXPECT_NE(consumer.error().text().find("name the devices"), std::string::npos);
}

TEST(DeviceSources, AreTheHashOfTheName) {
  // The published vectors of the 32-bit FNV-1a.
  EXPECT_EQ(source_of(""), 0x811c9dc5u);
  EXPECT_EQ(source_of("a"), 0xe40c292cu);
  EXPECT_EQ(source_of("foobar"), 0xbf9cf968u);
}

}  // namespace
}  // namespace rtpm::gvd
