#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

#include "programs.hpp"
#include "rtpm/gvd/consumer.hpp"
#include "rtpm/names/resolver.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/test/free_port.hpp"
#include "rtpm/test/os.hpp"
#include "rtpm/test/temporary_folder.hpp"
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

/// Why there are no programs of the other systems in the paper's Figure 3; empty if there are, or
/// none are asked for.
std::string missing_system() {
  const char* const folder = std::getenv(kOtherSystems);
  if (folder == nullptr || std::filesystem::exists(std::string(folder) + "/rtpm-deviced"))
    return {};
  return std::string(folder) + " is not there: run ./dev figure3 once";
}

class ThreeNodes : public WithRegistry {
 protected:
  void SetUp() override {
    if (const std::string missing = missing_system(); !missing.empty()) GTEST_SKIP() << missing;
    // The hand presses 10 mm deep, and stays.
    std::ofstream(hand_) << "0,0.004,0,0.01\n0.3,0.004,0,-0.01\n600,0.004,0,-0.01\n";
    prepare();
    registry_ = start_daemon("rtpm-registryd", with_rights({"--port", "0", "--realtime", "off"}));
    ASSERT_TRUE(registry_);
    meet_registry();
    device_ = start_device("0");
    ASSERT_TRUE(device_);
  }
  /// Before the registry starts, and behind it.
  virtual void prepare() {}
  virtual void meet_registry() {}
  /// The options of a server, with its file of rights.
  [[nodiscard]] std::vector<std::string> with_rights(std::vector<std::string> options) const {
    if (!authorized_.empty()) options.insert(options.end(), {"--authorized", authorized_});
    return options;
  }
  void TearDown() override { std::filesystem::remove(hand_); }

  [[nodiscard]] std::optional<Daemon> start_device(const std::string& port) const {
    return start_server("rtpm-deviced", with_rights({"--port", port, "--serve-events",
                                                     "--device-arm0-hand", hand_}));
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
  /// Ends a program in order. Returns its output.
  static std::string interrupt(test::Process& process) {
    process.send_signal(SIGINT);
    const auto end = process.wait(kPatience);
    EXPECT_TRUE(end && end->exit_code == 0) << (end ? end->errors : process.errors());
    return end ? end->output : std::string();
  }
  static void kill(test::Process& process) {
    process.send_signal(SIGKILL);
    ASSERT_TRUE(process.wait(kPatience));
  }

  std::string authorized_{};
  std::string hand_ = testing::TempDir() + "rtpm_scene_hand.csv";
  std::optional<Daemon> device_{};
};

class TouchedScene : public ThreeNodes, public testing::WithParamInterface<const char*> {
 protected:
  void SetUp() override {
    if (std::getenv(kOtherSystems) != nullptr && GetParam() != std::string_view("plane"))
      GTEST_SKIP() << "one solid shows how the systems meet";
    ThreeNodes::SetUp();
  }
};

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
  // Wine promises no times.
  const bool has_pace = std::getenv(kOtherSystems) == nullptr;
  EXPECT_GE(samples_hz, has_pace ? 50 : 5);
  EXPECT_LE(samples_hz, 65) << "it sets the pace, not the device";
  EXPECT_GE(touches_hz, has_pace ? 50 : 5);
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
  EXPECT_GE(cycle_count, has_pace ? 500u : 50u) << end->output;

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
  // Wine's server closes a dead program's sockets a little later.
  ASSERT_TRUE(test::await([&] { return test::is_free(device_->port()); }, kPatience));
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

/// The nodes with the keys of one user, who may do all.
class SealedNodes : public ThreeNodes {
 protected:
  void SetUp() override {
    if (std::getenv(kOtherSystems) == nullptr)
      GTEST_SKIP() << "a user's programs on one system talk through memory, unsealed";
    ThreeNodes::SetUp();
    if (IsSkipped() || HasFatalFailure()) return;
    for (const char* name : {kDevice, "rtpm/events"})
      expect_success({"key", "learn", name, "--yes", "--registry", registry_->url});
  }
  void prepare() override {
    ::setenv("RTPM_KEYS", keys_.path().c_str(), 1);
    const auto made = run_program("rtpm", {"key", "new"});
    const std::size_t key = made.output.find("rtpm25519 ");
    ASSERT_NE(key, std::string::npos) << made.output << made.errors;
    const std::string line = made.output.substr(key, made.output.find('\n', key) - key);
    authorized_ = keys_.file("authorized");
    expect_success({"key", "authorize", line, "--role", "administer", "--on", "**"});
  }
  void meet_registry() override { expect_success({"key", "learn", registry_->url, "--yes"}); }
  void TearDown() override {
    ThreeNodes::TearDown();
    ::unsetenv("RTPM_KEYS");
  }
  static void expect_success(const std::vector<std::string>& arguments) {
    const auto end = run_program("rtpm", arguments);
    EXPECT_EQ(end.exit_code, 0) << end.output << end.errors;
  }

  test::TemporaryFolder keys_{};
};

TEST_F(SealedNodes, TouchTheWall) {
  test::Process force = start_force("plane", "60");
  test::Process graphics = start_graphics();
  ASSERT_TRUE(graphics.wait_for_output("touching", kPatience))
      << graphics.output() << graphics.errors() << force.errors();
  const std::string drawn = interrupt(graphics);
  unsigned long on_surface_count = 0;
  unsigned long contact_count = 0;
  const std::size_t proxy = drawn.find("proxy on the surface in");
  ASSERT_NE(proxy, std::string::npos) << drawn;
  ASSERT_EQ(std::sscanf(drawn.c_str() + proxy, "proxy on the surface in %lu of %lu contacts",
                        &on_surface_count, &contact_count),
            2);
  EXPECT_GT(contact_count, 0u) << drawn;
  EXPECT_EQ(on_surface_count, contact_count);
  interrupt(force);
  // A caller without the user's key is not served.
  const auto stranger = test::run({"env", "RTPM_KEYS=" + keys_.file("none"), path_of("rtpm"),
                                   "info", device_->url, "--deadline", "2s"},
                                  kPatience);
  ASSERT_TRUE(stranger);
  EXPECT_NE(stranger->exit_code, 0) << stranger->output;
}

// The lease on its name ends with it.
TEST_F(ThreeNodes, AKilledDevicesNameLapses) {
  kill(device_->process);
  EXPECT_TRUE(test::await([&] { return rtpm({"list"}).output.find("LOST") != std::string::npos; },
                          kPatience));
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
