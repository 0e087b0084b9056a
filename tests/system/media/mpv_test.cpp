#include <signal.h>

#include <functional>

#include "control.hpp"
#include "player.hpp"
#include "programs.hpp"
#include "rtpm/device_mpv/mpv_driver.hpp"
#include "rtpm/device_mpv/settings.hpp"
#include "rtpm/device_sim/knob_driver.hpp"
#include "rtpm/rt/clock.hpp"

/// The driver with the real mpv.
namespace rtpm::system_test {
namespace {

using driver::ExchangeStatus;
using std::chrono::milliseconds;

constexpr Duration kPeriod = milliseconds{10};

class RealMpv : public WithMpv {
 protected:
  void start(device_mpv::Settings settings) {
    driver_ = std::make_unique<device_mpv::MpvDriver>(device_mpv::open_mpv(std::move(settings)),
                                                      "real-1", "player/base");
    restart();
  }
  void restart() {
    const auto configured = driver_->configure({.period = kPeriod});
    ASSERT_TRUE(configured) << configured.error().text();
    ASSERT_TRUE(driver_->activate());
  }
  ExchangeStatus exchange(double rate, double seek_s) {
    driver::Command command;
    command.mode = driver::CommandMode::kOutputs;
    command.cycle_time = rt::now();
    command.outputs = {static_cast<float>(rate), static_cast<float>(seek_s)};
    return driver_->exchange(command, sample_);
  }
  /// Exchanges once per period until `is_done`.
  bool exchange_until(double rate, double seek_s,
                      const std::function<bool(ExchangeStatus)>& is_done) {
    MonotonicTime due = rt::now();
    for (const MonotonicTime end = due + kPatience; due < end; due += kPeriod) {
      if (is_done(exchange(rate, seek_s))) return true;
      rt::sleep_until(due);
    }
    return false;
  }
  [[nodiscard]] double position_s() const { return sample_.analogs[0]; }

  std::unique_ptr<device_mpv::MpvDriver> driver_;
  driver::Sample sample_{};
};

TEST_F(RealMpv, PlaysItsFileForwardsAndBackwards) {
  start({.file = clip_, .is_headless = true});
  ASSERT_EQ(exchange(0, -1), ExchangeStatus::kOk);
  EXPECT_NEAR(sample_.analogs[2], 20, 0.1);
  ASSERT_TRUE(exchange_until(0, -1, [&](auto) { return sample_.analogs[4] > 0; }))
      << "known a little after the length";
  EXPECT_NEAR(sample_.analogs[4], kFrameSeconds, 1e-6);
  ASSERT_TRUE(exchange_until(0, 10, [&](auto) { return std::abs(position_s() - 10) < 0.02; }));
  ASSERT_TRUE(exchange_until(2, 10, [&](auto) { return position_s() > 10.5; }));
  EXPECT_EQ(sample_.analogs[1], 2);
  ASSERT_TRUE(exchange_until(-2, 10, [&](auto) { return position_s() < 9.5; }));
  EXPECT_EQ(sample_.analogs[1], -2);
  ASSERT_TRUE(exchange_until(0, 10, [&](auto) { return sample_.analogs[3] == 1; }));
}

TEST_F(RealMpv, StatesWhatMpvShows) {
  start_mpv();
  start({.socket = socket_});
  Observer mpv = observe();
  for (const double target_s : {12.0, 3.0, 3.04, 3.0, 19.92, 0.0}) {
    ASSERT_TRUE(exchange_until(
        0, target_s, [&](auto) { return std::abs(position_s() - target_s) < kFrameSeconds / 2; }));
    EXPECT_NEAR(mpv.shown_s().value_or(-1), target_s, kFrameSeconds / 2);
  }
}

TEST_F(RealMpv, IsGoneWhenItDiesUntilItReturns) {
  start_mpv();
  start({.socket = socket_});
  ASSERT_EQ(exchange(0, -1), ExchangeStatus::kOk);
  mpv_->send_signal(SIGKILL);
  ASSERT_TRUE(exchange_until(0, -1, [](auto status) { return status == ExchangeStatus::kGone; }));
  driver_->deactivate();
  EXPECT_FALSE(driver_->configure({.period = kPeriod})) << "nobody is there";
  start_mpv();
  restart();
  EXPECT_EQ(exchange(0, -1), ExchangeStatus::kOk);
}

TEST_F(RealMpv, IsGoneWhenItHangs) {
  start_mpv();
  start({.socket = socket_});
  ASSERT_EQ(exchange(0, -1), ExchangeStatus::kOk);
  mpv_->stop();
  ASSERT_TRUE(exchange_until(1, -1, [](auto status) { return status == ExchangeStatus::kGone; }));
  driver_->deactivate();
}

/// The simulated knob, which a hand turns to and fro on its own time line, and its requests.
class TurnedKnob {
 public:
  TurnedKnob() {
    static_cast<void>(knob_.configure({.period = milliseconds{1}}));
    static_cast<void>(knob_.activate());
    turn();
    control_.enter(media::Mode::kScrub, sample_.joints[0],
                   {.position_s = 10, .duration_s = 20, .frame_s = 0.04});
  }
  /// Turns until it requests another picture than before.
  double next_target_s() {
    const double before_s = control_.step(sample_.joints[0]).seek_s;
    for (int i = 0; i < 10'000; ++i) {
      turn();
      const double target_s = control_.step(sample_.joints[0]).seek_s;
      if (target_s != before_s) return target_s;
    }
    return before_s;
  }

 private:
  void turn() {
    driver::Command command;
    command.cycle_time = now_ += milliseconds{10};
    static_cast<void>(knob_.exchange(command, sample_));
  }
  device_sim::KnobDriver knob_{{}};
  media::Control control_{{.joint = 0, .effort_newton_metre_max = 0.05}, 4};
  driver::Sample sample_{};
  MonotonicTime now_{std::chrono::seconds{1000}};
};

TEST_F(RealMpv, FollowsTheKnobForwardsAndBackwards) {
  start_mpv();
  start({.socket = socket_});
  Observer mpv = observe();
  TurnedKnob knob;
  int forwards_count = 0;
  int backwards_count = 0;
  double before_s = 10;
  for (int i = 0; i < 100; ++i) {
    const double target_s = knob.next_target_s();
    ++(target_s > before_s ? forwards_count : backwards_count);
    before_s = target_s;
    static_cast<void>(exchange(0, target_s));
    ASSERT_TRUE(mpv.await_shown(target_s)) << target_s;
  }
  EXPECT_GT(forwards_count, 10);
  EXPECT_GT(backwards_count, 10);
}

}  // namespace
}  // namespace rtpm::system_test
