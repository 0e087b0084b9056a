#include <gtest/gtest.h>

#include <cmath>
#include <optional>

#include "control.hpp"
#include "cycle.hpp"
#include "rtpm/device_sim/knob_driver.hpp"

/// The feel of each mode on the simulated knob, rendered by its own loop in simulated time.
namespace rtpm::media {
namespace {

using std::chrono::milliseconds;

class FeltKnob {
 public:
  explicit FeltKnob(double hand_newton_metre) {
    device_sim::KnobConfig knob;
    knob.hand_newton_metre = hand_newton_metre;
    driver_.emplace(device_sim::TwinConfig{}, knob);
    gvd::CycleConfig config;
    config.safety = gvd::SafetyConfig::for_device(driver_->describe());
    cycle_.emplace(*driver_, config, SipKey{1, 2});
    RTPM_ASSERT(cycle_->begin(now_).has_value(), "it begins");
    cycle_->run(now_, 0);
    lease_ = *cycle_->lease().acquire();
  }
  void feel(Mode mode, const PlayerView& player) { control_.enter(mode, angle_rad(), player); }
  /// The least and greatest position within `span`, in detents of the mode.
  struct Range {
    double low = 1e9;
    double high = -1e9;
  };
  Range turn_for(Duration span) {
    Range range;
    for (const MonotonicTime end = now_ + span; now_ < end;) {
      const auto models = control_.models();
      static_cast<void>(cycle_->set_models({lease_, ++sequence_, gvd::ModelList{models}}));
      for (int i = 0; i < 10; ++i)
        cycle_->run(now_ += milliseconds{1}, 0);
      const double notch = control_.notch(angle_rad());
      range = {std::min(range.low, notch), std::max(range.high, notch)};
    }
    return range;
  }
  [[nodiscard]] double angle_rad() const { return cycle_->newest()->joints[0]; }

 private:
  std::optional<device_sim::KnobDriver> driver_;
  std::optional<gvd::DeviceCycle> cycle_;
  MonotonicTime now_{std::chrono::seconds{1000}};
  std::uint64_t lease_ = gvd::Lease::kNobody;
  std::uint32_t sequence_ = 0;
  Control control_{{.joint = 0, .effort_newton_metre_max = 0.05}, 4};
};

constexpr PlayerView kMiddle{.position_s = 30, .duration_s = 60, .frame_s = 0.04};

TEST(MediaFeel, LetsAHandThroughTheDetentsOfEachMode) {
  for (const Mode mode : {Mode::kSpeed, Mode::kScrub, Mode::kFrame}) {
    FeltKnob knob(0.004);
    knob.feel(mode, kMiddle);
    const auto range = knob.turn_for(std::chrono::seconds{8});
    EXPECT_GT(range.high - range.low, 5) << to_string(mode);
  }
}

TEST(MediaFeel, HoldsAKnobThatAHandPushesLightly) {
  for (const Mode mode : {Mode::kSpeed, Mode::kFrame}) {
    FeltKnob knob(0.0015);
    knob.feel(mode, kMiddle);
    const auto range = knob.turn_for(std::chrono::seconds{8});
    EXPECT_GT(range.low, -0.5) << to_string(mode);
    EXPECT_LT(range.high, 0.5) << to_string(mode);
  }
  FeltKnob scrubbed(0.0015);
  scrubbed.feel(Mode::kScrub, kMiddle);
  const auto range = scrubbed.turn_for(std::chrono::seconds{8});
  EXPECT_GT(range.high - range.low, 0.5) << "scrubbing is soft";
}

TEST(MediaFeel, StopsAtTheEndsOfTheClip) {
  FeltKnob knob(0.004);
  constexpr double kDetents = 3;  // The range to either side.
  knob.feel(Mode::kScrub, {.position_s = kDetents * Control::kScrubDetentSeconds,
                           .duration_s = 2 * kDetents * Control::kScrubDetentSeconds + 0.04,
                           .frame_s = 0.04});
  const auto range = knob.turn_for(std::chrono::seconds{12});
  EXPECT_GT(range.low, -kDetents - 1);
  EXPECT_LT(range.high, kDetents + 1);
  EXPECT_GT(range.high - range.low, kDetents) << "and turns between them";
}

}  // namespace
}  // namespace rtpm::media
