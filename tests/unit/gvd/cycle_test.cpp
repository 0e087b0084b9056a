#include "cycle.hpp"

#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <limits>
#include <random>
#include <string>
#include <thread>
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
  /// Lets `count` milliseconds pass.
  void run(int count = 1, std::uint32_t missed_count = 0) {
    for (int i = 0; i < count; ++i) {
      now_ += milliseconds{1};
      cycle_->run(now_, missed_count);
      if (cycle_->needs_maintenance(now_)) cycle_->maintain(now_);
    }
  }
  expected<void, DeviceOutcome> command(double newton, Duration hold = milliseconds{10}) {
    return cycle_->submit(
        {lease_, ++sequence_, hold, driver::Setpoint::with_wrench({{newton, 0, 0}, {}})}, now_);
  }
  void acquire() {
    const auto id = cycle_->lease().acquire();
    ASSERT_TRUE(id);
    lease_ = *id;
  }
  /// Brings the force to `newton`, after the soft start.
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

TEST_F(Cycle, PassesTimeAndForceDeadlineToTheDriver) {
  acquire();
  run(1);
  ASSERT_TRUE(command(2));
  run(1);
  EXPECT_EQ(driver_.last_command.cycle_time, now_);
  EXPECT_EQ(driver_.last_command.sequence, 2u);
  EXPECT_EQ(driver_.last_command.deadline, now_ - milliseconds{1} + milliseconds{30})
      << "hold and ramp after the command came";
}

// The contract requires zero force at hold + ramp + one period after the last command.
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
  EXPECT_EQ(command(1).error(), DeviceOutcome::kNotHolder);
  EXPECT_FALSE(sample().faults.has(Fault::kCommandLost)) << "no client commands";
}

TEST_F(Cycle, OnlyTheHolderCommands) {
  run();
  EXPECT_EQ(command(1).error(), DeviceOutcome::kNotHolder);
  acquire();
  EXPECT_TRUE(command(1));
  const std::uint64_t mine = lease_;
  lease_ = mine ^ 1;
  EXPECT_FALSE(command(2));
  EXPECT_FALSE(cycle_->request(lease_, Transition::kDeactivate));
  EXPECT_FALSE(cycle_->request(lease_, Release::kRecover));
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

TEST_F(Cycle, AHolderThatOnlyRenewsLosesTheLease) {
  acquire();
  reach(1);
  for (int i = 0; i < 101; ++i) {
    static_cast<void>(cycle_->lease().renew(lease_));
    run(100);
  }
  EXPECT_EQ(cycle_->lease().holder(), Lease::kNobody);
  EXPECT_EQ(cycle_->counters().lease_idle_count, 1u);
  EXPECT_EQ(cycle_->counters().lease_expired_count, 0u);
  EXPECT_EQ(cycle_->lease().state_of(lease_), LeaseState::kIdle);
  ASSERT_EQ(listener_.texts.size(), 1u);
  EXPECT_NE(listener_.texts[0].find("no command for 10000 ms"), std::string::npos);
  acquire();
  reach(1);
}

TEST_F(Cycle, AHolderThatCommandsNowAndThenKeepsTheLease) {
  acquire();
  for (int i = 0; i < 300; ++i) {
    if (i % 90 == 0) {
      ASSERT_TRUE(command(0)) << i;
    }
    ASSERT_TRUE(cycle_->lease().renew(lease_));
    run(100);
  }
  EXPECT_EQ(cycle_->lease().holder(), lease_);
}

TEST_F(Cycle, AnOperatorTakesTheLeaseOver) {
  acquire();
  // A multiple of the rate limit's step would pass through zero by chance.
  reach(4.3);
  const std::uint64_t former = lease_;
  EXPECT_EQ(cycle_->take_over(27999).error(), DeviceOutcome::kBelowOperatorPriority);
  ASSERT_TRUE(command(4.3)) << "nothing has changed";
  run();
  EXPECT_NEAR(applied(), 4.3, 1e-9);

  const auto taken = cycle_->take_over(28000);
  ASSERT_TRUE(taken);
  EXPECT_EQ(command(5).error(), DeviceOutcome::kNotHolder);
  EXPECT_FALSE(cycle_->lease().renew(former));
  EXPECT_FALSE(cycle_->lease().release(former));
  EXPECT_FALSE(cycle_->request(former, Transition::kDeactivate));
  EXPECT_EQ(cycle_->lease().state_of(former), LeaseState::kTakenOver);

  lease_ = *taken;
  int zero_count = 0;
  double newton = applied();
  for (int ms = 0; ms < 22; ++ms) {
    ASSERT_TRUE(command(-5));
    run();
    if (applied() == 0) {
      ++zero_count;
    } else if (zero_count == 0) {
      EXPECT_LE(applied(), newton) << "the former holder's force falls";
      EXPECT_GT(applied(), 0) << "the new one's is not in it";
      EXPECT_TRUE(listener_.texts.empty()) << "nothing takes time before the force is zero";
    }
    newton = applied();
  }
  EXPECT_GE(zero_count, 1);
  reach(-5);
  EXPECT_EQ(cycle_->counters().lease_taken_over_count, 1u);
  ASSERT_EQ(listener_.texts.size(), 1u);
  EXPECT_NE(listener_.texts[0].find("28000"), std::string::npos);
}

TEST_F(Cycle, OperatorsTakeOverOnceASecond) {
  ASSERT_TRUE(cycle_->take_over(28000));
  run(500);
  EXPECT_EQ(cycle_->take_over(32000).error(), DeviceOutcome::kTooSoon);
  run(502);
  EXPECT_TRUE(cycle_->take_over(28000));
}

TEST_F(Cycle, TheOperatorsPriorityIsConfigured) {
  CycleConfig config;
  config.operator_priority = 100;
  make(config);
  EXPECT_FALSE(cycle_->take_over(99));
  EXPECT_TRUE(cycle_->take_over(100));
}

TEST_F(Cycle, AFormerHoldersRequestsCountForNothing) {
  acquire();
  reach(5);
  ASSERT_FALSE(command(std::numeric_limits<double>::quiet_NaN()));
  run();
  ASSERT_TRUE(cycle_->request(lease_, Transition::kDeactivate));
  ASSERT_TRUE(cycle_->request(lease_, Release::kRecover));
  ASSERT_TRUE(cycle_->take_over(28000));
  run(2);
  EXPECT_EQ(sample().lifecycle, Lifecycle::kActive) << "it was not deactivated";
  EXPECT_TRUE(sample().faults.has(Fault::kCommandNotFinite)) << "nor the fault ended";
}

// Two clients push in opposite directions, however the lease changes hands.
TEST_F(Cycle, NeverMixesTwoClientsForces) {
  CycleConfig config;
  config.lease = {milliseconds{30}, milliseconds{200}, milliseconds{5}, milliseconds{20}};
  for (const std::uint32_t seed : {1u, 2u, 3u, 4u}) {
    make(config);
    std::mt19937 random(seed);
    std::array<std::uint64_t, 2> leases{};
    int change_count = 0;
    int last_sign = 0;
    std::uint64_t last_holder = Lease::kNobody;
    bool was_zero = true;
    for (int ms = 0; ms < 20'000; ++ms) {
      const std::size_t side = random() % 2;
      switch (random() % 40) {
        case 0:
          leases[side] = cycle_->take_over(28000).value_or(leases[side]);
          break;
        case 1:
          static_cast<void>(cycle_->lease().release(leases[side]));
          break;
        case 2:
        case 3:
          leases[side] = cycle_->lease().acquire().value_or(leases[side]);
          break;
        default:
          break;
      }
      for (const std::size_t client : {side, 1 - side}) {
        lease_ = leases[client];
        static_cast<void>(command(client == 0 ? 5 : -5));
      }
      run();
      const int sign = (applied() > 0) - (applied() < 0);
      if (sign == 0) {
        was_zero = true;
      } else {
        ASSERT_TRUE(was_zero || sign == last_sign) << "seed " << seed << ", at " << ms << " ms";
        const std::uint64_t holder = cycle_->lease().holder();
        if (holder != last_holder) ++change_count;
        last_holder = holder;
        if (was_zero) {
          ASSERT_EQ(holder, leases[sign > 0 ? 0 : 1]) << "whose force begins";
        }
        was_zero = false;
        last_sign = sign;
      }
    }
    EXPECT_GT(change_count, 50);
  }
}

/// A client of several threads that pushes in one direction whenever it holds the lease.
class Pusher {
 public:
  Pusher(DeviceCycle& cycle, double newton) noexcept : cycle_(cycle), newton_(newton) {}

  void act(std::uint32_t choice, MonotonicTime now) noexcept {
    switch (choice % 200) {
      case 0:
        if (const auto id = cycle_.take_over(28000)) lease_ = *id;
        break;
      case 1:
        static_cast<void>(cycle_.lease().release(lease_));
        break;
      case 2:
        static_cast<void>(cycle_.request(lease_, Release::kRecover));
        break;
      case 3:
      case 4:
        if (const auto id = cycle_.lease().acquire()) lease_ = *id;
        break;
      default:
        static_cast<void>(cycle_.submit({lease_, ++sequence_, milliseconds{10},
                                         driver::Setpoint::with_wrench({{newton_, 0, 0}, {}})},
                                        now));
        break;
    }
  }

 private:
  DeviceCycle& cycle_;
  double newton_;
  std::atomic<std::uint64_t> lease_{Lease::kNobody};
  std::atomic<std::uint32_t> sequence_{0};
};

TEST_F(Cycle, NeverMixesTwoClientsForcesFromManyThreads) {
  CycleConfig config;
  config.lease = {milliseconds{30}, milliseconds{200}, milliseconds{5}, milliseconds{20}};
  make(config);
  Pusher left(*cycle_, -4.3);
  Pusher right(*cycle_, 4.3);
  std::atomic<bool> is_done{false};
  std::atomic<MonotonicTime> clock{now_};
  std::vector<std::thread> threads;
  for (std::uint32_t i = 0; i < 4; ++i) {
    threads.emplace_back([&, i] {
      std::mt19937 random(i);
      while (!is_done) {
        (i % 2 == 0 ? left : right).act(static_cast<std::uint32_t>(random()), clock);
        std::this_thread::yield();
      }
    });
  }
  int turn_count = 0;
  int last_sign = 0;
  bool was_zero = true;
  // The clients' threads may get little CPU time: the loop runs until they have taken turns.
  for (int ms = 0; turn_count < 20 && ms < 2'000'000; ++ms) {
    run();
    clock = now_;
    if (ms % 8 == 0) std::this_thread::yield();
    const int sign = (applied() > 0) - (applied() < 0);
    if (sign != 0 && sign != last_sign) {
      EXPECT_TRUE(was_zero) << "at " << ms << " ms";
      ++turn_count;
      last_sign = sign;
    }
    was_zero = sign == 0;
  }
  is_done = true;
  for (std::thread& thread : threads)
    thread.join();
  EXPECT_EQ(turn_count, 20);
}

TEST_F(Cycle, AnOlderCommandIsRefused) {
  acquire();
  sequence_ = 0xfffffffe;
  EXPECT_TRUE(command(1));
  EXPECT_TRUE(command(1)) << "the counter wraps";
  EXPECT_TRUE(command(1));
  sequence_ -= 2;
  EXPECT_EQ(command(1).error(), DeviceOutcome::kSuperseded);
  EXPECT_EQ(cycle_->counters().old_command_count, 1u);
}

TEST_F(Cycle, ANonFiniteNumberIsRefusedAndLatchesUntilRecovery) {
  acquire();
  reach(5);
  EXPECT_EQ(command(std::numeric_limits<double>::quiet_NaN()).error(), DeviceOutcome::kNotFinite);
  run();
  EXPECT_EQ(applied(), 0);
  EXPECT_TRUE(sample().faults.has(Fault::kCommandNotFinite));
  ASSERT_TRUE(command(5));
  run(5);
  EXPECT_EQ(applied(), 0);
  ASSERT_TRUE(cycle_->request(lease_, Release::kRecover));
  run();
  EXPECT_EQ(applied(), 0) << "a command of before the recovery does not count";
  EXPECT_FALSE(sample().faults.has(Fault::kCommandNotFinite));
  reach(5);
}

TEST_F(Cycle, ANonFiniteNumberLatchesAlsoIfANewerCommandReplacesItWithinACycle) {
  acquire();
  reach(5);
  EXPECT_EQ(command(std::numeric_limits<double>::quiet_NaN()).error(), DeviceOutcome::kNotFinite);
  ASSERT_TRUE(command(5));
  run();
  EXPECT_EQ(applied(), 0);
  EXPECT_TRUE(sample().faults.has(Fault::kCommandNotFinite));
  ASSERT_TRUE(cycle_->request(lease_, Release::kRecover));
  run();
  EXPECT_FALSE(sample().faults.has(Fault::kCommandNotFinite));
  reach(5);
}

TEST_F(Cycle, ANonFiniteNumberOfAnEarlierHolderLatchesNothing) {
  acquire();
  reach(5);
  EXPECT_EQ(command(std::numeric_limits<double>::quiet_NaN()).error(), DeviceOutcome::kNotFinite);
  ASSERT_TRUE(cycle_->lease().release(lease_));
  acquire();
  run();
  EXPECT_FALSE(sample().faults.has(Fault::kCommandNotFinite));
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

TEST_F(Cycle, AnActiveDeviceWithoutACycleForLongIsLate) {
  run();
  EXPECT_TRUE(cycle_->newest(now_ + milliseconds{21})->faults.empty());
  EXPECT_TRUE(cycle_->newest(now_ + milliseconds{22})->faults.has(Fault::kDeviceLate));
  EXPECT_FLOAT_EQ(cycle_->newest(now_ + milliseconds{60})->success_rate, 0.4F);
  EXPECT_FLOAT_EQ(cycle_->newest(now_ + seconds{5})->success_rate, 0);
  EXPECT_TRUE(sample().faults.empty()) << "only for the reader of that time";
  cycle_->end(now_);
  EXPECT_TRUE(cycle_->newest(now_ + milliseconds{22})->faults.empty()) << "nobody waits for it";
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
  run(200);
  EXPECT_EQ(sample().lifecycle, Lifecycle::kActive) << "a busy host";
  run(1);
  EXPECT_EQ(sample().lifecycle, Lifecycle::kFault);
  EXPECT_EQ(cycle_->counters().gone_count, 1u);
  EXPECT_NE(listener_.texts.at(0).find("has sent nothing new for 200 ms"), std::string::npos);
}

TEST_F(Cycle, TheTimeAfterWhichADeviceIsGoneIsConfigured) {
  CycleConfig config;
  config.gone_after = milliseconds{50};
  make(config);
  driver_.script = [](const driver::Command&, driver::Sample&) { return ExchangeStatus::kLate; };
  run(50);
  EXPECT_EQ(sample().lifecycle, Lifecycle::kActive);
  run(1);
  EXPECT_EQ(sample().lifecycle, Lifecycle::kFault);
}

TEST_F(Cycle, TheForceOfADeviceWithoutDataEndsAfterTwentyCycles) {
  acquire();
  reach(5);
  driver_.script = [](const driver::Command&, driver::Sample&) { return ExchangeStatus::kLate; };
  for (int i = 0; i < 45; ++i) {
    ASSERT_TRUE(command(5));
    run();
  }
  EXPECT_EQ(sample().lifecycle, Lifecycle::kActive);
  EXPECT_EQ(applied(), 0) << "nobody knows where it is";
  driver_.script = {};
  reach(5);
}

TEST_F(Cycle, TheLogNamesWhatIsWrongWithADevicesData) {
  driver_.script = [](const driver::Command&, driver::Sample& sample) {
    sample.twist.linear_m_per_s.y = std::numeric_limits<double>::quiet_NaN();
    return ExchangeStatus::kOk;
  };
  run(201);
  ASSERT_EQ(listener_.texts.size(), 1u);
  EXPECT_NE(listener_.texts[0].find("a NaN or infinity, last in twist"), std::string::npos);
  driver_.script = [](const driver::Command&, driver::Sample&) { return ExchangeStatus::kCorrupt; };
  run(800);
  ASSERT_GE(listener_.texts.size(), 3u) << "back once, lost again";
  EXPECT_NE(listener_.texts[2].find("unreadable data"), std::string::npos) << listener_.texts[2];
}

TEST_F(Cycle, AStatusThatDoesNotExistCountsAsAFailure) {
  driver_.script = [](const driver::Command&, driver::Sample& sample) {
    sample.pose.position_m.x = 99;
    return static_cast<ExchangeStatus>(77);
  };
  run(10);
  EXPECT_TRUE(sample().faults.has(Fault::kDeviceCorrupt));
  EXPECT_EQ(sample().pose.position_m.x, 0);
  EXPECT_EQ(cycle_->counters().corrupt_count, 10u);
  run(191);
  EXPECT_EQ(sample().lifecycle, Lifecycle::kFault);
}

TEST_F(Cycle, ADriverSetsItsOwnFaultBitsOnly) {
  driver_.script = [](const driver::Command&, driver::Sample& sample) {
    sample.faults.set(Fault::kOutsideWorkspace);
    sample.faults.set(Fault::kEmergencyStop);
    sample.faults.set(Fault::kTooFast);
    return ExchangeStatus::kOk;
  };
  run();
  EXPECT_EQ(driver::to_text(sample().faults), "outside the workspace");
  cycle_->emergency_stop();
  run();
  EXPECT_TRUE(sample().faults.has(Fault::kEmergencyStop)) << "the server's own";
}

TEST_F(Cycle, AnImpossiblePoseOrTimeIsMarked) {
  const auto is_marked = [&](auto change) {
    driver_.script = [change](const driver::Command&, driver::Sample& sample) {
      sample.pose = {};
      change(sample);
      return ExchangeStatus::kOk;
    };
    run();
    EXPECT_FALSE(sample().faults.has(Fault::kDeviceCorrupt));
    return sample().faults.has(Fault::kImplausible);
  };
  run(10);
  EXPECT_FALSE(is_marked([](driver::Sample&) {}));
  EXPECT_TRUE(is_marked([](driver::Sample& sample) { sample.pose.position_m.z = 1e9; }));
  EXPECT_TRUE(is_marked([](driver::Sample& sample) { sample.pose.orientation = {0, 0, 0, 0}; }));
  EXPECT_TRUE(is_marked([](driver::Sample& sample) { sample.host_time += seconds{1}; }));
  EXPECT_TRUE(is_marked([](driver::Sample& sample) { sample.host_time -= seconds{2}; }));
  EXPECT_FALSE(is_marked([](driver::Sample& sample) { sample.host_time -= milliseconds{8}; }));
  EXPECT_FALSE(is_marked([](driver::Sample& sample) { sample.host_time = {}; })) << "none yet";
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
  EXPECT_EQ(command(1).error(), DeviceOutcome::kNotActive);
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
  EXPECT_FLOAT_EQ(sample().success_rate, 0.97F) << "each missed one counts";
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
  config.safety = SafetyConfig::for_device(driver_.describe());
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
