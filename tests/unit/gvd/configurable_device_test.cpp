#include "configurable_device.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <functional>
#include <memory>
#include <string>
#include <thread>

#include "device_jobs.hpp"
#include "rtpm/gvd/server.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/safety/parameters.hpp"
#include "scripted_driver.hpp"

/// A served device's parameters: the device's thread changes them between two cycles.
namespace rtpm::gvd {
namespace {

using driver::ParameterSetting;
using driver::ParameterValue;
using std::chrono::milliseconds;
using enum ConfigurationOutcome;

/// A device with a gain in steps of 0.5, at most 4, and a switch that is writable while inactive.
class TunedDriver final : public test::ScriptedDriver {
 public:
  [[nodiscard]] std::vector<driver::ParameterSpec> parameters() const override {
    return {{.name = name, .unit = "1", .low = 0, .high = 10, .default_value = 1.0},
            {.name = "on",
             .type = driver::ParameterType::kBool,
             .default_value = true,
             .mutability = driver::Mutability::kInactive}};
  }
  [[nodiscard]] expected<void, SetupError> set_parameters(
      std::span<ParameterSetting> settings) override {
    thread = std::this_thread::get_id();
    for (ParameterSetting& setting : settings) {
      if (setting.name == "on") continue;
      if (std::get<double>(setting.value) > 4)
        return setup_error("the gain is too high", "", "less");
      gain = std::floor(2 * std::get<double>(setting.value)) / 2;
      setting.value = gain;
    }
    return {};
  }
  [[nodiscard]] std::unique_ptr<driver::Calibration> make_calibration(
      std::string_view of) override {
    struct Nothing final : driver::Calibration {
      driver::CalibrationState step(const driver::Sample&,
                                    std::optional<std::string_view>) override {
        return driver::CalibrationFailed{"no"};
      }
    };
    return of == "gain" ? std::make_unique<Nothing>() : nullptr;
  }

  std::string name = "gain";
  double gain = 1;
  std::thread::id thread{};
};

/// A cycle without thread and clock; the test's thread acts as the device's thread.
class Cycled : public testing::Test {
 protected:
  Cycled() {
    cycle_.jobs().begin();
    EXPECT_TRUE(cycle_.begin(now_));
    run(1);
  }
  void run(int cycle_count, const std::function<void()>& before_each = {}) {
    for (int i = 0; i < cycle_count; ++i) {
      if (before_each) before_each();
      cycle_.run(now_ += milliseconds{1}, 0);
      if (cycle_.needs_maintenance(now_)) cycle_.maintain(now_);
    }
  }
  /// Applies `settings` on another thread, while this thread is between two cycles.
  expected<void, ConfigurationError> apply(std::vector<ParameterSetting>& settings,
                                           bool needs_inactive = false) {
    expected<void, ConfigurationError> outcome;
    std::atomic<bool> is_over{false};
    std::thread manager([&] {
      outcome = device_.apply(settings, needs_inactive);
      is_over = true;
    });
    while (!is_over) {
      if (cycle_.needs_maintenance(now_)) cycle_.maintain(now_);
      std::this_thread::yield();
    }
    manager.join();
    return outcome;
  }

  TunedDriver driver_{};
  driver::Descriptor descriptor_ = driver_.describe();
  DeviceCycle cycle_{driver_, {}, {1, 2}};
  ConfigurableDevice device_{driver_, descriptor_, cycle_};
  MonotonicTime now_{std::chrono::seconds{5}};
};

TEST_F(Cycled, HasTheDriversParametersAndTheServersOwn) {
  const auto specs = device_.parameters();
  const auto spec_of = [&](std::string_view name) {
    return *std::ranges::find(specs, name,
                              [](const auto& spec) -> std::string_view { return spec.name; });
  };
  EXPECT_EQ(specs.size(), 2 + safety_parameters(cycle_.safety()).size());
  EXPECT_EQ(specs[0].name, "gain");
  for (const driver::ParameterSpec& spec : specs)
    EXPECT_EQ(fault_of(spec), "") << spec.name;
  EXPECT_EQ(spec_of("safety.force_newton_max").high, 8) << "the device's limit";
  EXPECT_EQ(spec_of("safety.force_newton_max").default_value, ParameterValue(8.0));
  EXPECT_EQ(spec_of("safety.ramp_s").high, 0.02) << "as configured";
  EXPECT_EQ(spec_of("safety.soft_start_s").low, 0.2) << "only longer is safer";
  EXPECT_GT(spec_of("safety.force_newton_per_s_max").low, 0) << "else a force could not fall";
}

TEST_F(Cycled, ChangesBetweenTwoCyclesOnTheDevicesThreadAndReadsBack) {
  std::vector<ParameterSetting> settings{{"safety.ramp_s", 0.01}, {"gain", 2.7}};
  const auto applied = apply(settings);
  ASSERT_TRUE(applied) << applied.error().words.text();
  EXPECT_EQ(driver_.thread, std::this_thread::get_id());
  EXPECT_EQ(settings[0].value, ParameterValue(0.01));
  EXPECT_EQ(settings[1].value, ParameterValue(2.5)) << "as the device has taken it";
  EXPECT_EQ(cycle_.present_safety().ramp, milliseconds{10});
  EXPECT_EQ(cycle_.present_safety().force_newton_max, 8) << "the others stay";
}

TEST_F(Cycled, ChangesNothingThatTheDriverRefuses) {
  std::vector<ParameterSetting> settings{{"safety.ramp_s", 0.01}, {"gain", 5.0}};
  const auto applied = apply(settings);
  ASSERT_FALSE(applied);
  EXPECT_EQ(applied.error().outcome, kRefusedByDevice);
  EXPECT_NE(applied.error().words.text().find("the gain is too high"), std::string::npos);
  EXPECT_EQ(cycle_.present_safety().ramp, milliseconds{20});
  EXPECT_EQ(driver_.gain, 1);
}

TEST_F(Cycled, RefusesSomeParametersWhileActive) {
  std::vector<ParameterSetting> settings{{"on", false}};
  EXPECT_EQ(apply(settings, true).error().outcome, kWrongState);
  EXPECT_EQ(driver_.thread, std::thread::id{});
}

TEST_F(Cycled, AbandonsAChangeWithoutACycleInTime) {
  std::vector<ParameterSetting> settings{{"gain", 2.0}};
  EXPECT_EQ(device_.apply(settings, false).error().outcome, kBusy);
  bool has_happened = false;
  EXPECT_FALSE(cycle_.jobs().perform([&] { has_happened = true; }, Duration{0}));
  EXPECT_FALSE(cycle_.needs_maintenance(now_));
  cycle_.maintain(now_);
  EXPECT_FALSE(has_happened);
  EXPECT_EQ(driver_.gain, 1);
  EXPECT_TRUE(apply(settings)) << "the next one does";
}

TEST_F(Cycled, AnInactiveDeviceChangesToo) {
  const auto lease = cycle_.lease().acquire();
  ASSERT_TRUE(lease);
  run(1);
  ASSERT_TRUE(cycle_.request(*lease, Transition::kDeactivate));
  run(1);
  ASSERT_FALSE(device_.is_active());
  std::vector<ParameterSetting> settings{{"on", false}};
  EXPECT_TRUE(apply(settings, true));
}

TEST_F(Cycled, ALoweredLimitHoldsForTheNextCommands) {
  const auto lease = cycle_.lease().acquire();
  ASSERT_TRUE(lease);
  std::uint32_t sequence = 0;
  const auto push = [&] {
    driver::Setpoint setpoint;
    setpoint.mode = driver::CommandMode::kForce;
    setpoint.wrench.force_newton.x = 6;
    ASSERT_TRUE(cycle_.submit({*lease, ++sequence, milliseconds{100}, setpoint}, now_));
  };
  run(1);
  run(300, push);
  EXPECT_EQ(driver_.last_command.wrench.force_newton.x, 6);
  std::vector<ParameterSetting> settings{{"safety.force_newton_max", 2.0}};
  ASSERT_TRUE(apply(settings));
  run(10, push);
  EXPECT_NEAR(driver_.last_command.wrench.force_newton.x, 2, 1e-12);
}

TEST_F(Cycled, ADeviceThatIsBackHasItsValues) {
  std::vector<ParameterSetting> settings{{"gain", 3.0}, {"safety.force_newton_max", 2.0}};
  ASSERT_TRUE(apply(settings));
  driver_.script = [](const driver::Command&, driver::Sample&) {
    return driver::ExchangeStatus::kGone;
  };
  run(1);
  ASSERT_EQ(cycle_.lifecycle(), driver::Lifecycle::kFault);
  settings = {{"gain", 3.5}};
  ASSERT_TRUE(apply(settings)) << "a lost device is configured, too";
  driver_.script = {};
  now_ += std::chrono::seconds{1};
  run(2);
  ASSERT_EQ(cycle_.lifecycle(), driver::Lifecycle::kActive);
  EXPECT_EQ(driver_.configure_count, 2);
  EXPECT_EQ(driver_.gain, 3.5);
  EXPECT_EQ(cycle_.present_safety().force_newton_max, 2);
}

TEST_F(Cycled, MakesCalibrationsLikewise) {
  cycle_.jobs().end();
  EXPECT_TRUE(device_.make_calibration("gain"));
  EXPECT_EQ(device_.make_calibration("other").error().outcome, kUnknownCalibration);
  cycle_.jobs().begin();
  EXPECT_EQ(device_.make_calibration("gain").error().outcome, kBusy);
}

TEST(ConfiguredServer, ChangesAtOnceUnlessItRuns) {
  auto driver = std::make_unique<TunedDriver>();
  const TunedDriver& tuned = *driver;
  DeviceServerConfig config;
  config.thread.realtime = rt::RealtimeMode::kOff;
  auto server = DeviceServer::create(std::move(driver), config);
  ASSERT_TRUE(server) << server.error().text();
  Configurable& configurable = (*server)->configurable();
  std::vector<ParameterSetting> settings{{"gain", 2.0}};
  ASSERT_TRUE(configurable.apply(settings, true));
  EXPECT_EQ(tuned.thread, std::this_thread::get_id()) << "before the start";
  ASSERT_TRUE((*server)->start());
  EXPECT_TRUE(configurable.is_active());
  expected<void, ConfigurationError> applied;
  const MonotonicTime until = rt::now() + std::chrono::seconds{10};
  // If the machine does not run the device's thread for 100 ms, the answer is busy.
  do {
    applied = configurable.apply(settings, false);
  } while (!applied && applied.error().outcome == kBusy && rt::now() < until);
  ASSERT_TRUE(applied);
  EXPECT_NE(tuned.thread, std::this_thread::get_id());
  EXPECT_EQ(configurable.apply(settings, true).error().outcome, kWrongState);
  (*server)->stop();
  ASSERT_TRUE(configurable.apply(settings, true));
  EXPECT_EQ(tuned.thread, std::this_thread::get_id()) << "after the stop";
}

TEST(ConfiguredServer, RefusesADriverWithAParameterInItsOwnGroup) {
  auto driver = std::make_unique<TunedDriver>();
  driver->name = "safety.gain";
  const auto server = DeviceServer::create(std::move(driver));
  ASSERT_FALSE(server);
  EXPECT_NE(server.error().text().find("safety.gain"), std::string::npos);
}

}  // namespace
}  // namespace rtpm::gvd
