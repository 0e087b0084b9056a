#include <gtest/gtest.h>

#include <memory>
#include <optional>
#include <vector>

#include "cycle.hpp"
#include "delay_line.hpp"
#include "feel.hpp"
#include "rtpm/device_sim/sim_driver.hpp"
#include "wall.hpp"

/// A hand presses the simulated arm into a wall, on a simulated time line of one cycle per
/// millisecond, over a link with delay. No clock, no thread.
namespace rtpm::servo {
namespace {

using gvd::DeviceCycle;
using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr Wall kWall{.face_m = 0, .stiffness_newton_per_m = 600, .damping_newton_s_per_m = 0.5};

/// The device, and the client's lease.
class Pressed {
 public:
  Pressed() {
    auto driver = device_sim::SimDriver::create({});
    RTPM_ASSERT(driver.has_value(), "the default arm exists");
    driver_ = std::move(*driver);
    // The guard would brake the late wall, which hides how soft it is.
    gvd::CycleConfig config;
    config.safety = gvd::SafetyConfig::for_device(driver_->describe());
    config.safety->has_passivity_guard = false;
    cycle_.emplace(*driver_, config, SipKey{1, 2});
    RTPM_ASSERT(cycle_->begin(now_).has_value(), "it begins");
    cycle_->run(now_, 0);
    lease_ = *cycle_->lease().acquire();
  }

  /// Ten seconds with five presses. The client computes its force from a sample that is `delay`
  /// old, and the command takes another `delay` to the device.
  Feel render_remotely(Duration delay) {
    DelayLine<driver::Vector3, 2048> link(2 * delay);
    for (int i = 0; i < 10'000; ++i) {
      const driver::Vector3 force = link.pass(now_, touch_.force_newton);
      static_cast<void>(cycle_->submit(
          {lease_, ++sequence_, milliseconds{10}, driver::Setpoint::with_wrench({force, {}})},
          now_));
      step();
    }
    return feel_;
  }
  /// Like render_remotely(), but the client sends models, at the beginning and then every
  /// 200 ms; they take `delay` to arrive.
  Feel render_locally(Duration delay) {
    const std::vector<gvd::Model> models{kWall.as_plane()};
    for (int i = 0; i < 10'000; ++i) {
      if (milliseconds{i} >= delay &&
          (milliseconds{i} - delay) % milliseconds{200} == Duration{0}) {
        static_cast<void>(cycle_->set_models({lease_, ++sequence_, gvd::ModelList{models}}));
      }
      step();
    }
    return feel_;
  }

 private:
  void step() {
    now_ += milliseconds{1};
    cycle_->run(now_, 0);
    touch_ = proxy_.touch(*cycle_->newest());
    feel_.record(touch_, *cycle_->newest());
  }

  std::unique_ptr<device_sim::SimDriver> driver_;
  std::optional<DeviceCycle> cycle_;
  MonotonicTime now_{seconds{1000}};
  std::uint64_t lease_ = gvd::Lease::kNobody;
  std::uint32_t sequence_ = 0;
  scene::GodObject proxy_{kWall.proxy()};
  scene::Touch touch_{};
  Feel feel_{};
};

Feel remotely(Duration delay) {
  return Pressed{}.render_remotely(delay);
}
Feel locally(Duration delay) {
  return Pressed{}.render_locally(delay);
}

TEST(LocalWall, IsFeltAsStiffAtAnyDelayAsAtNone) {
  const Feel near = locally(Duration{0});
  EXPECT_NEAR(near.stiffness_newton_per_m(), kWall.stiffness_newton_per_m,
              0.02 * kWall.stiffness_newton_per_m);
  EXPECT_GT(near.depth_m_max(), 0.002) << "the hand presses";
  for (const int delay_ms : {1, 5, 20, 50}) {
    const Feel far = locally(milliseconds{delay_ms});
    EXPECT_NEAR(far.stiffness_newton_per_m(), near.stiffness_newton_per_m(),
                0.01 * near.stiffness_newton_per_m())
        << delay_ms << " ms";
    EXPECT_NEAR(far.depth_m_max(), near.depth_m_max(), 0.01 * near.depth_m_max())
        << delay_ms << " ms";
  }
}

TEST(RemoteWall, IsTheSameWithoutDelay) {
  const Feel local = locally(Duration{0});
  const Feel remote = remotely(Duration{0});
  EXPECT_NEAR(remote.stiffness_newton_per_m(), local.stiffness_newton_per_m(),
              0.02 * local.stiffness_newton_per_m());
  EXPECT_NEAR(remote.depth_m_max(), local.depth_m_max(), 0.02 * local.depth_m_max());
}

TEST(RemoteWall, IsSoftAndDeepUnderDelay) {
  const Feel local = locally(milliseconds{20});
  const Feel remote = remotely(milliseconds{20});
  EXPECT_LT(remote.stiffness_newton_per_m(), 0.7 * local.stiffness_newton_per_m());
  EXPECT_GT(remote.depth_m_max(), 1.5 * local.depth_m_max());
}

}  // namespace
}  // namespace rtpm::servo
