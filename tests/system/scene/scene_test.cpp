#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <mutex>
#include <string>
#include <vector>

#include "programs.hpp"
#include "rtpm/gvd/consumer.hpp"
#include "rtpm/names/resolver.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/test/os.hpp"
#include "touch_event.hpp"

/// The paper's §3.1 as three processes: the device's, the force loop, the graphics.
namespace rtpm::system_test {
namespace {

using std::chrono::milliseconds;

constexpr const char* kDevice = "lab/arm0";
/// The hold of rtpm-servo, the ramp of rtpm-deviced, and one period of the device.
constexpr Duration kForceBound = milliseconds{10} + milliseconds{20} + milliseconds{1};

double length(const driver::Vector3& vector) {
  return std::hypot(vector.x, vector.y, vector.z);
}

/// A fourth node, which sees every sample of the device.
class Observer final : public gvd::SampleSink {
 public:
  struct Seen {
    MonotonicTime time{};
    double force_newton = 0;
  };

  explicit Observer(const std::string& registry) : resolver_(node_, registry) {
    node_.use(resolver_);
    gvd::DeviceConsumerConfig config;
    config.subscription.realtime = rt::RealtimeMode::kOff;
    config.subscription.delivery.queue_capacity = 4096;
    config.subscription.deadline = kPatience;
    auto consumer = gvd::DeviceConsumer::start(node_, kDevice, config, *this);
    EXPECT_TRUE(consumer) << consumer.error().text();
    if (consumer) consumer_.emplace(std::move(*consumer));
  }
  void push(const driver::Sample& sample) override {
    const std::lock_guard lock(mutex_);
    seen_.push_back({sample.host_time, length(sample.wrench_applied.force_newton)});
  }
  /// The samples measured after `time`.
  [[nodiscard]] std::vector<Seen> after(MonotonicTime time) const {
    const std::lock_guard lock(mutex_);
    std::vector<Seen> later;
    std::ranges::copy_if(seen_, std::back_inserter(later),
                         [time](const Seen& one) { return one.time > time; });
    return later;
  }
  /// Waits until this many samples with force, or without, were measured after `time`.
  [[nodiscard]] bool await(MonotonicTime time, bool has_force, std::ptrdiff_t count) const {
    return test::await(
        [&] {
          return std::ranges::count_if(after(time), [has_force](const Seen& one) {
                   return (one.force_newton > 0) == has_force;
                 }) >= count;
        },
        kPatience);
  }

 private:
  mutable std::mutex mutex_;
  std::vector<Seen> seen_{};  ///< Guarded by `mutex_`.
  rpc::Node node_;
  names::RegistryResolver resolver_;
  std::optional<gvd::DeviceConsumer> consumer_{};
};

class ThreeNodes : public WithRegistry {
 protected:
  void SetUp() override {
    // The hand presses 10 mm deep, and stays.
    std::ofstream(hand_) << "0,0.004,0,0.01\n0.3,0.004,0,-0.01\n600,0.004,0,-0.01\n";
    WithRegistry::SetUp();
    device_ = start_device("0");
    ASSERT_TRUE(device_);
  }
  void TearDown() override { std::filesystem::remove(hand_); }

  [[nodiscard]] std::optional<Daemon> start_device(const std::string& port) const {
    return start_server("rtpm-deviced",
                        {"--port", port, "--serve-events", "--device-arm0-hand", hand_});
  }
  [[nodiscard]] test::Process start_force(const std::string& scene,
                                          const std::string& seconds) const {
    return test::Process({path_of("rtpm-servo"), "--registry", registry_->url, "--realtime", "off",
                          "--live", "off", "--events", "rtpm/events", "--scene", scene, "--seconds",
                          seconds});
  }
  [[nodiscard]] test::Process start_graphics() const {
    return test::Process({path_of("rtpm-scene"), "--registry", registry_->url, "--live", "lines"});
  }
  /// Ends a program in order.
  static void interrupt(test::Process& process) {
    process.send_signal(SIGINT);
    const auto end = process.wait(kPatience);
    ASSERT_TRUE(end);
    EXPECT_EQ(end->exit_code, 0) << end->errors;
  }
  static void kill(test::Process& process) {
    process.send_signal(SIGKILL);
    ASSERT_TRUE(process.wait(kPatience));
  }

  std::string hand_ = testing::TempDir() + "rtpm_scene_hand.csv";
  std::optional<Daemon> device_{};
};

class TouchedScene : public ThreeNodes, public testing::WithParamInterface<const char*> {};

INSTANTIATE_TEST_SUITE_P(Of, TouchedScene, testing::Values("plane", "sphere", "texture"),
                         [](const auto& tested) { return std::string(tested.param); });

TEST_P(TouchedScene, IsDrawnFromAllItsUpdates) {
  const std::string picture = testing::TempDir() + "rtpm_scene.svg";
  std::filesystem::remove(picture);
  test::Process force = start_force(GetParam(), "60");
  const Observer observer(registry_->url);
  ASSERT_TRUE(observer.await({}, true, 1)) << force.errors();
  const auto graphics = run_program("rtpm-scene", {"--registry", registry_->url, "--seconds", "2",
                                                   "--live", "off", "--picture", picture});
  EXPECT_EQ(graphics.exit_code, 0) << graphics.errors;

  unsigned long frame_count = 0;
  unsigned long on_surface_count = 0;
  unsigned long contact_count = 0;
  double samples_hz = 0;
  double touches_hz = 0;
  ASSERT_EQ(std::sscanf(graphics.output.c_str(),
                        "%lu frames in %*s s of %lf samples/s and %lf touches/s; proxy on the "
                        "surface in %lu of %lu contacts",
                        &frame_count, &samples_hz, &touches_hz, &on_surface_count, &contact_count),
            5)
      << graphics.output;
  EXPECT_GE(frame_count, 100u);
  EXPECT_GE(samples_hz, 50);
  EXPECT_LE(samples_hz, 65) << "it sets the pace, not the device";
  EXPECT_GE(touches_hz, 50);
  EXPECT_GT(contact_count, 0u);
  EXPECT_EQ(on_surface_count, contact_count) << "the proxy enters the solid, or leaves it";

  force.send_signal(SIGINT);
  const auto end = force.wait(kPatience);
  ASSERT_TRUE(end);
  EXPECT_EQ(end->exit_code, 0) << end->errors;
  expect_text(end->output, {std::string(" a remote ") + GetParam() + " of 600 N/m"});
  unsigned long cycle_count = 0;
  const std::size_t at = end->output.find("  cycles ");
  ASSERT_NE(at, std::string::npos) << end->output;
  ASSERT_EQ(std::sscanf(end->output.c_str() + at, "  cycles %lu", &cycle_count), 1);
  // There are 2000 in the 2 s of drawing; the limit is generous, as this machine may be busy.
  EXPECT_GE(cycle_count, 500u) << end->output;

  std::ifstream file(picture);
  const std::string drawn(std::istreambuf_iterator<char>(file), {});
  EXPECT_TRUE(drawn.starts_with("<svg ")) << drawn.substr(0, 100);
  EXPECT_NE(drawn.find(std::string("lab/arm0 at the ") + GetParam()), std::string::npos);
  std::filesystem::remove(picture);
}

TEST_F(ThreeNodes, TheForceLoopGoesOnWithoutGraphics) {
  test::Process force = start_force("sphere", "60");
  test::Process graphics = start_graphics();
  ASSERT_TRUE(graphics.wait_for_output("touching", kPatience)) << graphics.errors();
  const Observer observer(registry_->url);
  kill(graphics);
  const MonotonicTime dead = rt::now();
  EXPECT_TRUE(observer.await(dead + milliseconds{200}, true, 200)) << "the force has ended";
  EXPECT_FALSE(force.wait(milliseconds{1})) << "the force node has ended";
  test::Process again = start_graphics();
  EXPECT_TRUE(again.wait_for_output("touching", kPatience)) << again.errors();
  interrupt(again);
  interrupt(force);
}

TEST_F(ThreeNodes, TheDevicesForceEndsInItsBoundWithoutTheForceNode) {
  test::Process force = start_force("sphere", "60");
  test::Process graphics = start_graphics();
  const Observer observer(registry_->url);
  ASSERT_TRUE(graphics.wait_for_output("touching", kPatience)) << graphics.errors();
  ASSERT_TRUE(observer.await(rt::now(), true, 100));
  kill(force);
  const MonotonicTime dead = rt::now();
  ASSERT_TRUE(observer.await(dead + kForceBound, false, 200));
  for (const Observer::Seen& seen : observer.after(dead + kForceBound)) {
    ASSERT_EQ(seen.force_newton, 0)
        << std::chrono::duration<double, std::milli>(seen.time - dead).count()
        << " ms after the force node's end";
  }
  ASSERT_TRUE(graphics.wait_for_output("force is silent", kPatience)) << graphics.output();
  // The dead client's lease ends first, then another client may command.
  EXPECT_TRUE(test::await(
      [&] {
        test::Process successor = start_force("sphere", "0.2");
        const auto end = successor.wait(kPatience);
        return end && end->exit_code == 0;
      },
      kPatience));
  interrupt(graphics);
}

TEST_F(ThreeNodes, GraphicsOutliveTheDevice) {
  test::Process force = start_force("texture", "60");
  test::Process graphics = start_graphics();
  ASSERT_TRUE(graphics.wait_for_output("touching", kPatience)) << graphics.errors();
  const std::string port = std::to_string(device_->port());
  kill(device_->process);
  const auto end = force.wait(kPatience);
  ASSERT_TRUE(end) << "it goes on without its device";
  expect_one_sentence(*end, 3, {kDevice});
  ASSERT_TRUE(graphics.wait_for_output("device is silent", kPatience)) << graphics.output();
  device_ = start_device(port);
  ASSERT_TRUE(device_);
  EXPECT_TRUE(test::await(
      [&] {
        static_cast<void>(graphics.wait_for_output("never printed", milliseconds{100}));
        const std::string& output = graphics.output();
        return output.rfind("force is silent") != std::string::npos &&
               output.rfind("force is silent") > output.rfind("device is silent");
      },
      kPatience))
      << "it does not draw the device that is back: " << graphics.output();
  interrupt(graphics);
}

TEST_F(ThreeNodes, AGraphicsNodeWithoutAHubSaysSo) {
  expect_one_sentence(run_program("rtpm-scene", {"--registry", registry_->url, "--events",
                                                 "nowhere/events", "--seconds", "1"}),
                      1, {"nowhere/events"});
  EXPECT_EQ(run_program("rtpm-scene", {"--picture", "picture.png"}).exit_code, 2);
  expect_one_sentence(
      run_program("rtpm-servo", {"--registry", registry_->url, "--events", "nowhere/events"}), 1,
      {"nowhere/events"});
}

}  // namespace
}  // namespace rtpm::system_test
