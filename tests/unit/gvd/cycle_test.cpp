#include "rtpm/gvd/cycle.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <string>
#include <vector>

#include "scripted_driver.hpp"

namespace rtpm::gvd {
namespace {

using driver::ExchangeStatus;
using driver::Fault;
using driver::Lifecycle;
using driver::Wrench;
using std::chrono::milliseconds;
using std::chrono::seconds;

class Listener final : public DeviceListener {
 public:
  void report(std::string_view text) override { texts.emplace_back(text); }
  std::vector<std::string> texts;
};

/// A device on a simulated time line of one cycle per millisecond.
class Cycle : public ::testing::Test {
 protected:
  Cycle() { make({}); }

  void make(CycleConfig config) {
    config.listener = &listener_;
    cycle_.emplace(driver_, config, SipKey{1, 2});
    ASSERT_TRUE(cycle_->begin(now_));
  }
  /// Lets `count` milliseconds go by.
  void run(int count = 1, std::uint32_t missed_count = 0) {
    for (int i = 0; i < count; ++i) {
      now_ += milliseconds{1};
      cycle_->run(now_, missed_count);
      if (cycle_->needs_maintenance(now_)) cycle_->maintain(now_);
    }
  }
  rpc::Result<void> command(double newton, Duration hold = milliseconds{10}) {
    return cycle_->submit({lease_, ++sequence_, hold, {{newton, 0, 0}, {}}}, now_);
  }
  void acquire() {
    const auto id = cycle_->lease().acquire();
    ASSERT_TRUE(id);
    lease_ = *id;
  }
  /// A force that stands at `newton`, soft start over.
  void reach(double newton) {
    for (int i = 0; i < 300; ++i) {
      ASSERT_TRUE(command(newton));
      run();
    }
    ASSERT_NEAR(applied(), newton, 1e-9);
  }
  double applied() const { return driver_.last_command.wrench.force_newton.x; }
  driver::Sample sample() const { return *cycle_->newest(); }

  test::ScriptedDriver driver_;
  Listener listener_;
  std::optional<DeviceCycle> cycle_;
  MonotonicTime now_{seconds{1000}};
  std::uint64_t lease_ = Lease::kNobody;
  std::uint32_t sequence_ = 0;
};

TEST_F(Cycle, PublishesASampleEveryCycle) {
  EXPECT_FALSE(cycle_->newest());
  run(3);
  EXPECT_EQ(sample().sequence, 3u);
  EXPECT_EQ(sample().lifecycle, Lifecycle::kActive);
  EXPECT_EQ(sample().host_time, now_);
  EXPECT_EQ(sample().success_rate, 1.0F);
  EXPECT_TRUE(sample().faults.empty());
}

TEST_F(Cycle, TellsTheDriverTheTimeAndTheEndOfItsForce) {
  acquire();
  ASSERT_TRUE(command(2));
  run(1);
  EXPECT_EQ(driver_.last_command.cycle_time, now_);
  EXPECT_EQ(driver_.last_command.sequence, 1u);
  EXPECT_EQ(driver_.last_command.deadline, now_ - milliseconds{1} + milliseconds{30})
      << "hold and ramp after the command came";
}

// The bound of the contract: hold + ramp + one period after the last command.
TEST_F(Cycle, ForceIsZeroWithinItsBoundOnceTheClientIsGone) {
  acquire();
  reach(5);
  const MonotonicTime last = now_ - milliseconds{1};
  double newton = applied();
  while (now_ < last + milliseconds{10 + 20 + 1}) {
    run();
    const Duration silence = now_ - last;
    if (silence < milliseconds{10}) {
      EXPECT_NEAR(applied(), 5, 1e-9) << "a short silence goes unfelt";
    } else {
      EXPECT_LE(applied(), newton);
    }
    newton = applied();
  }
  EXPECT_EQ(applied(), 0);
  EXPECT_EQ(driver_.last_command.mode, driver::CommandMode::kOff);
  EXPECT_TRUE(sample().faults.has(Fault::kCommandLost)) << "the loss shows";
  EXPECT_EQ(cycle_->counters().safety.lost_count, 1u) << "and is counted";
  run(100);
  EXPECT_EQ(applied(), 0) << "and it stays";
  EXPECT_LT(sample().success_rate, 0.5F);
}

TEST_F(Cycle, AHoldThatIsTooLongIsShortened) {
  acquire();
  for (int i = 0; i < 300; ++i) {
    ASSERT_TRUE(command(5, std::chrono::hours{1}));
    run();
  }
  run(100 + 20);
  EXPECT_EQ(applied(), 0);
}

TEST_F(Cycle, ASilentHolderLosesTheLease) {
  acquire();
  reach(1);
  run(1001);
  EXPECT_EQ(cycle_->lease().holder(), Lease::kNobody);
  EXPECT_EQ(cycle_->counters().lease_expired_count, 1u);
  const auto refused = command(1);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error(), rpc::Refusal::kNotLeaseHolder);
  EXPECT_FALSE(sample().faults.has(Fault::kCommandLost)) << "nobody commands any more";
}

TEST_F(Cycle, OnlyTheHolderCommands) {
  run();
  const auto nobody = command(1);
  ASSERT_FALSE(nobody);
  EXPECT_EQ(nobody.error(), rpc::Refusal::kNotLeaseHolder);
  acquire();
  EXPECT_TRUE(command(1));
  const std::uint64_t mine = lease_;
  lease_ = mine ^ 1;
  EXPECT_FALSE(command(2));
  EXPECT_FALSE(cycle_->request(lease_, Transition::kDeactivate));
  EXPECT_FALSE(cycle_->request_recovery(lease_));
  EXPECT_EQ(cycle_->counters().foreign_command_count, 2u);
  EXPECT_EQ(cycle_->counters().command_count, 1u);
}

TEST_F(Cycle, TheFormerHoldersCommandDoesNotLiveOn) {
  acquire();
  reach(5);
  ASSERT_TRUE(command(5, milliseconds{100}));
  ASSERT_TRUE(cycle_->lease().release(lease_));
  acquire();
  run(22);
  EXPECT_EQ(applied(), 0) << "the new holder has not commanded yet";
  ASSERT_TRUE(command(5));
  run();
  EXPECT_LT(applied(), 0.1) << "and begins softly";
}

TEST_F(Cycle, ANewHolderBeginsSoftlyEvenWithoutAGap) {
  acquire();
  reach(5);
  ASSERT_TRUE(cycle_->lease().release(lease_));
  acquire();
  for (int i = 0; i < 50; ++i) {
    ASSERT_TRUE(command(5));
    run();
  }
  EXPECT_LT(applied(), 2) << "a quarter of the soft start";
}

TEST_F(Cycle, AnOlderCommandIsRefused) {
  acquire();
  sequence_ = 0xfffffffe;
  EXPECT_TRUE(command(1));
  EXPECT_TRUE(command(1)) << "the counter wraps";
  EXPECT_TRUE(command(1));
  sequence_ -= 2;
  const auto old = command(1);
  ASSERT_FALSE(old);
  EXPECT_EQ(old.error(), rpc::Refusal::kBadRequest);
  EXPECT_EQ(cycle_->counters().old_command_count, 1u);
}

TEST_F(Cycle, ANumberThatIsNoneIsRefusedAndLatchesTillRecovery) {
  acquire();
  reach(5);
  const auto refused = command(std::numeric_limits<double>::quiet_NaN());
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error(), rpc::Refusal::kBadRequest);
  run();
  EXPECT_EQ(applied(), 0);
  EXPECT_TRUE(sample().faults.has(Fault::kCommandNotFinite));
  ASSERT_TRUE(command(5));
  run(5);
  EXPECT_EQ(applied(), 0);
  ASSERT_TRUE(cycle_->request_recovery(lease_));
  run();
  EXPECT_EQ(applied(), 0) << "a command of before the recovery does not count";
  EXPECT_FALSE(sample().faults.has(Fault::kCommandNotFinite));
  reach(5);
}

TEST_F(Cycle, LateAndCorruptCyclesChangeNoValueAndShow) {
  driver_.script = [](const driver::Command&, driver::Sample& sample) {
    sample.pose.position_m.x = 7;
    return ExchangeStatus::kOk;
  };
  run();
  driver_.script = [](const driver::Command&, driver::Sample& sample) {
    sample.pose.position_m.x = 99;
    return ExchangeStatus::kLate;
  };
  run();
  EXPECT_EQ(sample().pose.position_m.x, 7) << "whatever the driver scribbled";
  EXPECT_TRUE(sample().faults.has(Fault::kDeviceLate));
  driver_.script = [](const driver::Command&, driver::Sample& sample) {
    sample.twist.linear_m_per_s.y = std::numeric_limits<double>::infinity();
    return ExchangeStatus::kOk;
  };
  run();
  EXPECT_TRUE(sample().faults.has(Fault::kDeviceCorrupt)) << "a sample must be finite";
  EXPECT_EQ(sample().twist.linear_m_per_s.y, 0);
  EXPECT_EQ(cycle_->counters().late_count, 1u);
  EXPECT_EQ(cycle_->counters().corrupt_count, 1u);
  driver_.script = {};
  run();
  EXPECT_TRUE(sample().faults.empty());
  EXPECT_FLOAT_EQ(sample().success_rate, 0.5F);
}

TEST_F(Cycle, ALostDeviceLosesForceAndLeaseAndComesBack) {
  acquire();
  reach(5);
  driver_.script = [](const driver::Command&, driver::Sample&) { return ExchangeStatus::kGone; };
  run();
  EXPECT_EQ(sample().lifecycle, Lifecycle::kFault);
  EXPECT_TRUE(sample().faults.has(Fault::kDeviceGone));
  EXPECT_EQ(sample().wrench_applied, Wrench{});
  EXPECT_FALSE(driver_.is_active) << "it was closed";
  EXPECT_FALSE(command(5)) << "the lease is gone with it";
  EXPECT_EQ(listener_.texts.size(), 1u);

  driver_.script = {};
  driver_.configure_error = "the cable is out";
  run(600);
  EXPECT_EQ(driver_.configure_count, 2) << "one try in half a second";
  EXPECT_EQ(sample().lifecycle, Lifecycle::kFault);
  EXPECT_EQ(sample().success_rate, 0.0F);
  driver_.configure_error.clear();
  run(600);
  EXPECT_EQ(sample().lifecycle, Lifecycle::kActive);
  EXPECT_TRUE(sample().faults.empty());
  EXPECT_EQ(listener_.texts.size(), 2u) << "lost once, back once";
  acquire();
  reach(5);
}

TEST_F(Cycle, ManyBadCyclesInARowCountAsGone) {
  driver_.script = [](const driver::Command&, driver::Sample&) { return ExchangeStatus::kLate; };
  run(20);
  EXPECT_EQ(sample().lifecycle, Lifecycle::kActive);
  run(1);
  EXPECT_EQ(sample().lifecycle, Lifecycle::kFault);
  EXPECT_EQ(cycle_->counters().gone_count, 1u);
}

TEST_F(Cycle, TheHolderTakesTheDeviceOutOfAndIntoOperation) {
  acquire();
  reach(5);
  ASSERT_TRUE(cycle_->request(lease_, Transition::kDeactivate));
  run(2);
  EXPECT_EQ(sample().lifecycle, Lifecycle::kInactive);
  EXPECT_EQ(sample().wrench_applied, Wrench{});
  EXPECT_FALSE(driver_.is_active);
  const int exchange_count = driver_.exchange_count;
  const auto refused = command(1);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error(), rpc::Refusal::kGone);
  run(900);
  EXPECT_EQ(driver_.exchange_count, exchange_count) << "at rest, and it stays so";
  ASSERT_TRUE(cycle_->lease().renew(lease_));
  ASSERT_TRUE(cycle_->request(lease_, Transition::kActivate));
  run(2);
  EXPECT_EQ(sample().lifecycle, Lifecycle::kActive);
  reach(5);
}

TEST_F(Cycle, AMissedCycleLowersTheSuccessRate) {
  run(99);
  run(1, 3);
  EXPECT_EQ(cycle_->counters().missed_count, 3u);
  EXPECT_FLOAT_EQ(sample().success_rate, 0.99F);
  run(100);
  EXPECT_FLOAT_EQ(sample().success_rate, 1.0F) << "the last hundred count";
}

TEST_F(Cycle, TheEndTakesTheForceAway) {
  acquire();
  reach(5);
  cycle_->end(now_);
  EXPECT_FALSE(driver_.is_active);
  EXPECT_EQ(sample().lifecycle, Lifecycle::kFinalized);
  EXPECT_EQ(sample().wrench_applied, Wrench{});
  EXPECT_EQ(cycle_->lease().holder(), Lease::kNobody);
}

TEST_F(Cycle, TakesTighterLimitsThanTheDevices) {
  CycleConfig config;
  config.safety = SafetyConfig::for_device(driver_.describe().limits);
  config.safety->force_newton_max = 2;
  make(config);
  acquire();
  for (int i = 0; i < 300; ++i) {
    ASSERT_TRUE(command(5));
    run();
  }
  EXPECT_NEAR(applied(), 2, 1e-9);
  EXPECT_TRUE(sample().faults.has(Fault::kForceClamped));
}

}  // namespace
}  // namespace rtpm::gvd
