#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "cycle.hpp"
#include "scripted_driver.hpp"

/// Local models in the device's cycle, on a simulated time line of one cycle per millisecond.
namespace rtpm::gvd {
namespace {

using driver::CommandMode;
using driver::Fault;
using driver::Lifecycle;
using driver::Vector3;
using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr double kDepthMetre = 0.01;

/// Material below z = 0: it pushes with 4 N at kDepthMetre.
constexpr Plane kFloor{{}, {0, 0, 1}, 400, 0};

class ModelsInTheCycle : public ::testing::Test {
 protected:
  ModelsInTheCycle() {
    driver_.script = [this](const driver::Command&, driver::Sample& sample) {
      sample.pose.position_m = at_m_;
      sample.twist.linear_m_per_s = velocity_m_per_s_;
      sample.joints[0] = angle_rad_;
      return status_;
    };
    make();
  }

  void make() {
    cycle_.emplace(driver_, CycleConfig{}, SipKey{1, 2});
    ASSERT_TRUE(cycle_->begin(now_));
    acquire();
    run();
  }
  void acquire() {
    const auto id = cycle_->lease().acquire();
    ASSERT_TRUE(id);
    lease_ = *id;
  }
  void run(int count = 1) {
    for (int i = 0; i < count; ++i) {
      now_ += milliseconds{1};
      cycle_->run(now_, 0);
      if (cycle_->needs_maintenance(now_)) cycle_->maintain(now_);
    }
  }
  /// Runs `count` cycles as a holder that renews its lease now and then, but commands nothing.
  void run_renewed(int count) {
    for (int i = 0; i < count; ++i) {
      if (i % 100 == 0) {
        ASSERT_TRUE(cycle_->lease().renew(lease_));
      }
      run();
    }
  }
  expected<void, ModelsRefusal> set(const std::vector<Model>& models) {
    return cycle_->set_models({lease_, ++sequence_, ModelList{models}});
  }
  expected<void, DeviceOutcome> command(const Vector3& newton) {
    return cycle_->submit(
        {lease_, ++sequence_, milliseconds{10}, driver::Setpoint::with_wrench({newton, {}})}, now_);
  }
  /// Brings the floor to its full 4 N, after the soft start.
  void rest_on_the_floor() {
    ASSERT_TRUE(set({kFloor}));
    run_renewed(300);
    ASSERT_NEAR(applied().z, 4, 1e-9);
  }
  Vector3 applied() const { return driver_.last_command.wrench.force_newton; }
  driver::Sample sample() const { return *cycle_->newest(); }

  Vector3 at_m_{0, 0, -kDepthMetre};
  Vector3 velocity_m_per_s_{};
  double angle_rad_ = 0;
  driver::ExchangeStatus status_ = driver::ExchangeStatus::kOk;
  test::ScriptedDriver driver_;
  std::optional<DeviceCycle> cycle_;
  MonotonicTime now_{seconds{1000}};
  std::uint64_t lease_ = Lease::kNobody;
  std::uint32_t sequence_ = 0;
};

TEST_F(ModelsInTheCycle, NeedNoCommandsWhileTheLeaseIsHeld) {
  rest_on_the_floor();
  run_renewed(5000);
  EXPECT_NEAR(applied().z, 4, 1e-9);
  EXPECT_FALSE(sample().faults.has(Fault::kCommandLost));
  EXPECT_EQ(sample().success_rate, 1.0F);
  at_m_.z = -kDepthMetre / 2;
  run(3);
  EXPECT_NEAR(applied().z, 2, 1e-9) << "at most two cycles after the motion, and by the force rate";
  EXPECT_EQ(driver_.last_command.deadline, now_ + milliseconds{10 + 20})
      << "should this thread stop, the device's own watchdog ends the force";
}

TEST_F(ModelsInTheCycle, StartSoftly) {
  ASSERT_TRUE(set({kFloor}));
  run();
  EXPECT_LT(applied().z, 0.1);
  EXPECT_TRUE(sample().faults.has(Fault::kSoftStart));
}

TEST_F(ModelsInTheCycle, AddToTheCommandAndOutliveIt) {
  rest_on_the_floor();
  for (int i = 0; i < 20; ++i) {
    ASSERT_TRUE(command({1, 0, 0.5}));
    run();
  }
  EXPECT_NEAR(applied().x, 1, 1e-9);
  EXPECT_NEAR(applied().z, 4.5, 1e-9);
  run_renewed(30);
  EXPECT_NEAR(applied().x, 0, 1e-9) << "the command is over";
  EXPECT_NEAR(applied().z, 4, 1e-9) << "the model is not";
}

TEST_F(ModelsInTheCycle, AreReplacedAsAWhole) {
  rest_on_the_floor();
  ASSERT_TRUE(set({Plane{{}, {0, 0, 1}, 100, 0}, Friction{0, 0, 0.1}}));
  velocity_m_per_s_ = {2, 0, 0};
  run(10);
  EXPECT_NEAR(applied().x, -0.2, 1e-9);
  EXPECT_NEAR(applied().z, 1, 1e-9) << "nothing of the former list is left";
  ASSERT_TRUE(set({}));
  run(21);
  EXPECT_EQ(applied(), Vector3{});
}

TEST_F(ModelsInTheCycle, AreUnchangedByARefusedList) {
  rest_on_the_floor();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const double stiffness : {nan, 1e9, -1.0}) {
    const auto refused = set({kFloor, Plane{{}, {0, 0, 1}, stiffness, 0}});
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().outcome, DeviceOutcome::kOutOfRange);
    EXPECT_EQ(refused.error().error->index, 1u);
    EXPECT_EQ(refused.error().error->field, "stiffness_newton_per_m");
  }
  run_renewed(10);
  EXPECT_NEAR(applied().z, 4, 1e-9);
  EXPECT_FALSE(sample().faults.has(Fault::kCommandNotFinite));
}

TEST_F(ModelsInTheCycle, AreSetByTheHolderAlone) {
  EXPECT_EQ(
      cycle_->set_models({lease_ ^ 1, 1, ModelList{std::vector<Model>{kFloor}}}).error().outcome,
      DeviceOutcome::kNotHolder);
  sequence_ = 10;
  ASSERT_TRUE(set({kFloor}));
  sequence_ = 5;
  EXPECT_EQ(set({}).error().outcome, DeviceOutcome::kSuperseded);
}

// The force must be zero one ramp and one period after the lease's end.
TEST_F(ModelsInTheCycle, EndByTheRampWhenTheHolderReleases) {
  rest_on_the_floor();
  ASSERT_TRUE(cycle_->lease().release(lease_));
  const MonotonicTime end = now_;
  double newton = applied().z;
  while (now_ < end + milliseconds{20 + 1}) {
    run();
    EXPECT_LE(applied().z, newton);
    EXPECT_GE(applied().z, newton - 0.5) << "a ramp, no step";
    newton = applied().z;
  }
  EXPECT_EQ(applied(), Vector3{});
  run(100);
  acquire();
  run(300);
  EXPECT_EQ(applied(), Vector3{}) << "they do not come back with the next lease";
}

TEST_F(ModelsInTheCycle, EndByTheRampWhenTheHolderFallsSilent) {
  rest_on_the_floor();
  const MonotonicTime last = now_;
  double newton = applied().z;
  while (now_ < last + seconds{1} + milliseconds{20 + 1}) {
    run();
    EXPECT_GE(applied().z, newton - 0.5) << "a ramp, no step";
    newton = applied().z;
  }
  EXPECT_EQ(applied(), Vector3{});
}

TEST_F(ModelsInTheCycle, EndByTheRampWhenAnOperatorTakesOver) {
  rest_on_the_floor();
  const auto operator_lease = cycle_->take_over(Priority{28000});
  ASSERT_TRUE(operator_lease);
  run();
  EXPECT_GT(applied().z, 3.5);
  run(20);
  EXPECT_EQ(applied(), Vector3{});
}

TEST_F(ModelsInTheCycle, EndWithAnEmergencyStop) {
  rest_on_the_floor();
  cycle_->emergency_stop();
  run();
  EXPECT_EQ(applied(), Vector3{});
  EXPECT_EQ(set({kFloor}).error().outcome, DeviceOutcome::kEmergencyStop);
  ASSERT_TRUE(cycle_->request(lease_, Release::kRearm));
  run_renewed(300);
  EXPECT_EQ(applied(), Vector3{}) << "no force that nobody set again";
}

TEST_F(ModelsInTheCycle, EndWithRecoverButThoseSetAfterItStay) {
  rest_on_the_floor();
  ASSERT_FALSE(command({std::numeric_limits<double>::quiet_NaN(), 0, 0}));
  run();
  EXPECT_EQ(applied(), Vector3{}) << "a number that is not finite takes the models' force, too";
  ASSERT_TRUE(cycle_->request(lease_, Release::kRecover));
  run_renewed(300);
  EXPECT_EQ(applied(), Vector3{});
  // Both happen before one cycle, in either order.
  ASSERT_TRUE(set({kFloor}));
  ASSERT_TRUE(cycle_->request(lease_, Release::kRecover));
  run_renewed(300);
  EXPECT_EQ(applied(), Vector3{});
  ASSERT_TRUE(cycle_->request(lease_, Release::kRecover));
  ASSERT_TRUE(set({kFloor}));
  run_renewed(300);
  EXPECT_NEAR(applied().z, 4, 1e-9);
}

TEST_F(ModelsInTheCycle, HideNoCommandThatIsNotFinite) {
  rest_on_the_floor();
  // The command ends before the next cycle.
  const auto setpoint =
      driver::Setpoint::with_wrench({{std::numeric_limits<double>::quiet_NaN(), 0, 0}, {}});
  ASSERT_FALSE(cycle_->submit({lease_, ++sequence_, Duration{0}, setpoint}, now_));
  run_renewed(50);
  EXPECT_EQ(applied(), Vector3{});
  EXPECT_TRUE(sample().faults.has(Fault::kCommandNotFinite));
}

TEST_F(ModelsInTheCycle, EndWithDeactivate) {
  rest_on_the_floor();
  ASSERT_TRUE(cycle_->request(lease_, Transition::kDeactivate));
  run(2);
  ASSERT_EQ(cycle_->lifecycle(), Lifecycle::kInactive);
  EXPECT_EQ(set({kFloor}).error().outcome, DeviceOutcome::kNotActive);
  ASSERT_TRUE(cycle_->request(lease_, Transition::kActivate));
  run_renewed(300);
  EXPECT_EQ(cycle_->lifecycle(), Lifecycle::kActive);
  EXPECT_EQ(applied(), Vector3{});
}

TEST_F(ModelsInTheCycle, EndWithALostDevice) {
  rest_on_the_floor();
  status_ = driver::ExchangeStatus::kGone;
  run();
  status_ = driver::ExchangeStatus::kOk;
  run(600);
  ASSERT_EQ(cycle_->lifecycle(), Lifecycle::kActive);
  acquire();
  run(300);
  EXPECT_EQ(applied(), Vector3{});
}

/// The number of models in each list that an observer was told.
class ModelCounts final : public CycleObserver {
 public:
  void on_cycle(const CycleRecord& record) noexcept override { cycle_ = record.sample.sequence; }
  void on_models(const ModelsRecord& record) noexcept override {
    EXPECT_EQ(record.cycle, cycle_);
    counts_.push_back(record.list.models().size());
  }
  [[nodiscard]] std::vector<std::size_t> take() { return std::exchange(counts_, {}); }

 private:
  std::uint64_t cycle_ = 0;
  std::vector<std::size_t> counts_{};
};

TEST_F(ModelsInTheCycle, AreReportedToTheObserverWhenTheyChangeAndEnd) {
  ModelCounts seen;
  cycle_.emplace(driver_, CycleConfig{.observer = &seen}, SipKey{1, 2});
  ASSERT_TRUE(cycle_->begin(now_));
  acquire();
  run(10);
  EXPECT_EQ(seen.take(), std::vector<std::size_t>{});
  ASSERT_TRUE(set({kFloor}));
  run_renewed(10);
  ASSERT_TRUE(set({kFloor, Friction{0, 0, 0.1}}));
  run_renewed(10);
  EXPECT_EQ(seen.take(), (std::vector<std::size_t>{1, 2}));
  ASSERT_TRUE(cycle_->lease().release(lease_));
  run(10);
  EXPECT_EQ(seen.take(), std::vector<std::size_t>{0}) << "released";
  run(200);
  acquire();
  ASSERT_TRUE(set({kFloor}));
  run(1500);
  EXPECT_EQ(seen.take(), (std::vector<std::size_t>{1, 0})) << "silent";
  acquire();
  ASSERT_TRUE(set({kFloor}));
  run();
  cycle_->emergency_stop();
  run(10);
  EXPECT_EQ(seen.take(), (std::vector<std::size_t>{1, 0})) << "stopped";
}

TEST_F(ModelsInTheCycle, BecomeTheEffortOfADial) {
  driver_.descriptor.joints = {{"dial", "rad", 0, 0, 0, 0.05}};
  driver_.descriptor.modes = {CommandMode::kJointEffort};
  driver_.descriptor.limits = {};
  make();
  ASSERT_TRUE(set({DialDetents{.spacing_rad = 0.4, .effort_newton_metre = 0.02}}));
  angle_rad_ = 0.1;
  run_renewed(300);
  EXPECT_EQ(driver_.last_command.mode, CommandMode::kJointEffort);
  EXPECT_NEAR(driver_.last_command.joints[0], -0.02, 1e-9);
  ASSERT_TRUE(cycle_->lease().release(lease_));
  run(21);
  EXPECT_EQ(driver_.last_command.joints[0], 0);
}

// Random walls, fields and dampers in a random motion: no list exceeds the device's limits.
TEST_F(ModelsInTheCycle, KeepTheLimitsForAnyList) {
  std::mt19937_64 random(11);
  const auto between = [&random](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  const auto point = [&](double most) {
    return Vector3{between(-most, most), between(-most, most), between(-most, most)};
  };
  Vector3 before{};
  double greatest_newton = 0;
  for (int turn = 0; turn < 300; ++turn) {
    std::vector<Model> models;
    for (std::size_t i = 0; i < ModelList::kCountMax; ++i) {
      switch (random() % 4) {
        case 0:
          models.emplace_back(Plane{point(0.1), {0, 1, 0}, between(0, 500), 0});
          break;
        case 1:
          models.emplace_back(Sphere{point(0.1), 0.05, Side::kSolid, between(0, 250), 0.3});
          break;
        case 2:
          models.emplace_back(Spring{point(0.1), between(0, 500), 0, 8});
          break;
        default:
          models.emplace_back(Friction{between(0, 8), 400, 0.1});
      }
    }
    ASSERT_TRUE(set(models));
    for (int i = 0; i < 20; ++i) {
      at_m_ = point(0.2);
      velocity_m_per_s_ = point(2);
      run();
      const Vector3 now = applied();
      const double newton = std::hypot(now.x, now.y, now.z);
      ASSERT_LE(newton, 8 * (1 + 1e-9)) << "force_newton_max, turn " << turn;
      ASSERT_LE(std::hypot(now.x - before.x, now.y - before.y, now.z - before.z), 1 + 1e-9)
          << "1000 N/s, turn " << turn;
      greatest_newton = std::max(greatest_newton, newton);
      before = now;
    }
  }
  EXPECT_GT(greatest_newton, 7.5) << "the limit was reached";
}

}  // namespace
}  // namespace rtpm::gvd
