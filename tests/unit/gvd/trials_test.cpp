#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <deque>
#include <memory>
#include <optional>
#include <random>
#include <string>

#include "cycle.hpp"
#include "rtpm/device_sim/sim_driver.hpp"

/// A thousand random trials of each loss, on the simulated arm and a simulated time line: by the
/// model's own record the force is zero within hold + ramp + one cycle, and no limit is exceeded.
namespace rtpm::gvd {
namespace {

using driver::Vector3;
using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr unsigned kTrialCount = 1000;
constexpr Duration kPeriod = milliseconds{1};

/// The arm, with a plug to pull and a record of its motors' output.
class RecordedArm final : public driver::Driver {
 public:
  explicit RecordedArm(std::unique_ptr<device_sim::SimDriver> arm) : arm_(std::move(arm)) {}

  [[nodiscard]] driver::Descriptor describe() const override { return arm_->describe(); }
  [[nodiscard]] expected<void, SetupError> configure(const driver::DriverConfig& config) override {
    if (is_unplugged) return setup_error("no arm answers");
    return arm_->configure(config);
  }
  [[nodiscard]] expected<void, SetupError> activate() override { return arm_->activate(); }
  [[nodiscard]] driver::ExchangeStatus exchange(const driver::Command& command,
                                                driver::Sample& sample) noexcept override {
    // An unplugged arm has no power.
    if (is_unplugged) {
      newton = 0;
      return driver::ExchangeStatus::kGone;
    }
    const auto status = arm_->exchange(command, sample);
    const Vector3& force = sample.wrench_applied.force_newton;
    newton = std::hypot(force.x, force.y, force.z);
    newton_max = std::max(newton_max, newton);
    velocity_max = std::max(velocity_max,
                            std::hypot(sample.twist.linear_m_per_s.x, sample.twist.linear_m_per_s.y,
                                       sample.twist.linear_m_per_s.z));
    return status;
  }
  void deactivate() noexcept override {
    newton = 0;
    arm_->deactivate();
  }

  bool is_unplugged = false;
  double newton = 0;  ///< The force in the last cycle.
  double newton_max = 0;
  double velocity_max = 0;

 private:
  std::unique_ptr<device_sim::SimDriver> arm_;
};

/// One trial: a client that pushes at random, over a link with random delays.
class Trial {
 public:
  explicit Trial(unsigned seed) : random_(seed) {
    device_sim::SimConfig config;
    config.seed = seed;
    config.is_held = random_() % 4 != 0;
    auto arm = device_sim::SimDriver::create(config);
    RTPM_ASSERT(arm.has_value(), "the default arm exists");
    arm_ = std::make_unique<RecordedArm>(std::move(*arm));
    cycle_.emplace(*arm_, CycleConfig{}, SipKey{seed, 2});
    RTPM_ASSERT(cycle_->begin(now_).has_value(), "it begins");
    cycle_->run(now_, 0);
    lease_ = *cycle_->lease().acquire();
    delay_ = microseconds{random_() % 3000};
    hold_ = milliseconds{5 + random_() % 120};
  }

  /// Lets the client command for a while; a loss may come at any phase of a cycle.
  void push_for_a_while() {
    const int count = 50 + static_cast<int>(random_() % 250);
    for (int i = 0; i < count; ++i) {
      send();
      step();
    }
  }
  /// Puts a command on its way to the device.
  void send() {
    const double newton = between(0, 15);
    Vector3 force{between(-1, 1), between(-1, 1), between(-1, 1)};
    const double length = std::max(1e-3, std::hypot(force.x, force.y, force.z));
    force = {force.x / length * newton, force.y / length * newton, force.z / length * newton};
    link_.push_back({now_ + delay_ + microseconds{random_() % 500},
                     {lease_, ++sequence_, hold_, driver::Setpoint::with_wrench({force, {}})}});
  }
  /// Runs one cycle, up to 0.2 ms late, with the commands that have arrived by then.
  void step() {
    now_ += kPeriod;
    const MonotonicTime begin = now_ + microseconds{random_() % 200};
    while (!link_.empty() && link_.front().arrives <= begin) {
      const MonotonicTime arrived = link_.front().arrives;
      if (cycle_->submit(link_.front().command, arrived)) {
        last_end_ = arrived + std::min(hold_, cycle_->safety().hold_max);
      }
      link_.pop_front();
    }
    cycle_->run(begin, 0);
    if (cycle_->needs_maintenance(begin)) cycle_->maintain(begin);
    last_cycle_ = begin;
  }
  /// Runs on without new commands, and checks the bound.
  void expect_the_force_ends(const std::string& what) {
    const Duration ramp = cycle_->safety().ramp;
    for (int i = 0; i < 200; ++i) {
      step();
      if (last_cycle_ >= last_end_ + ramp) {
        ASSERT_EQ(arm_->newton, 0) << what << ", " << (last_cycle_ - last_end_).count() << " ns";
      }
    }
    expect_the_limits(what);
  }
  void expect_the_limits(const std::string& what) const {
    ASSERT_LE(arm_->newton_max, cycle_->safety().force_newton_max * (1 + 1e-9)) << what;
  }

  double between(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }
  std::mt19937& random() { return random_; }
  RecordedArm& arm() { return *arm_; }
  DeviceCycle& cycle() { return *cycle_; }
  MonotonicTime now() const { return now_; }
  [[nodiscard]] std::uint64_t lease() const { return lease_; }

  struct Flight {
    MonotonicTime arrives{};
    ClientCommand command{};
  };
  std::deque<Flight> link_{};

 private:
  std::mt19937 random_;
  std::unique_ptr<RecordedArm> arm_{};
  std::optional<DeviceCycle> cycle_{};
  MonotonicTime now_{seconds{1000}};
  MonotonicTime last_cycle_{};
  MonotonicTime last_end_{};  ///< The end of the last accepted command.
  std::uint64_t lease_ = Lease::kNobody;
  std::uint32_t sequence_ = 0;
  Duration delay_{};
  Duration hold_{};
};

std::string name_of(const char* loss, unsigned seed) {
  return std::string(loss) + ", seed " + std::to_string(seed);
}

/// Returns how many trials had a force to lose, which shows that they test something.
template <class Lose>
unsigned run_trials(const char* loss, Lose lose) {
  unsigned with_force = 0;
  for (unsigned seed = 1; seed <= kTrialCount; ++seed) {
    Trial trial(seed);
    trial.push_for_a_while();
    if (trial.arm().newton > 0) ++with_force;
    lose(trial, name_of(loss, seed));
    if (::testing::Test::HasFatalFailure()) return 0;
  }
  return with_force;
}

TEST(AThousandTrials, EndTheForceOfAKilledClient) {
  const unsigned with_force = run_trials("killed", [](Trial& trial, const std::string& what) {
    // Commands in flight still arrive.
    trial.expect_the_force_ends(what);
  });
  EXPECT_GT(with_force, kTrialCount * 9 / 10);
}

TEST(AThousandTrials, EndTheForceOfAStoppedClientThatGoesOnLater) {
  const unsigned with_force = run_trials("stopped", [](Trial& trial, const std::string& what) {
    trial.expect_the_force_ends(what);
    if (::testing::Test::HasFatalFailure()) return;
    // The client resumes, as after SIGCONT; later it is stopped for longer than its lease.
    trial.push_for_a_while();
    trial.expect_the_force_ends(what + ", again");
    for (int i = 0; i < 1200; ++i)
      trial.step();
    trial.send();
    for (int i = 0; i < 20; ++i)
      trial.step();
    ASSERT_EQ(trial.arm().newton, 0) << what << ": its lease has ended";
  });
  EXPECT_GT(with_force, kTrialCount * 9 / 10);
}

TEST(AThousandTrials, EndTheForceAfterACutLink) {
  const unsigned with_force = run_trials("cut", [](Trial& trial, const std::string& what) {
    // First the link loses and reorders; then it is cut, with everything in flight.
    for (int i = 0; i < 50; ++i) {
      trial.send();
      if (trial.random()() % 3 == 0) trial.link_.pop_back();
      if (trial.link_.size() > 1 && trial.random()() % 3 == 0) {
        std::swap(trial.link_.front().command, trial.link_.back().command);
      }
      trial.step();
    }
    trial.link_.clear();
    trial.expect_the_force_ends(what);
  });
  EXPECT_GT(with_force, kTrialCount * 9 / 10);
}

TEST(AThousandTrials, EndTheForceOfAStoppedServer) {
  const unsigned with_force = run_trials("server", [](Trial& trial, const std::string& what) {
    trial.cycle().end(trial.now());
    ASSERT_EQ(trial.arm().newton, 0) << what << ": at once";
    trial.expect_the_limits(what);
  });
  EXPECT_GT(with_force, kTrialCount * 9 / 10);
}

TEST(AThousandTrials, EndTheForceOfAnUnpluggedDevice) {
  const unsigned with_force = run_trials("unplugged", [](Trial& trial, const std::string& what) {
    trial.arm().is_unplugged = true;
    trial.send();
    trial.step();
    ASSERT_EQ(trial.cycle().lifecycle(), driver::Lifecycle::kFault) << what;
    trial.arm().is_unplugged = false;
    // The device is back within a second; the former client's commands have no effect.
    int ms = 0;
    for (; ms < 1000 && trial.cycle().lifecycle() != driver::Lifecycle::kActive; ++ms) {
      trial.send();
      trial.step();
      ASSERT_EQ(trial.arm().newton, 0) << what;
    }
    ASSERT_LT(ms, 1000) << what;
    for (int i = 0; i < 50; ++i) {
      trial.send();
      trial.step();
      ASSERT_EQ(trial.arm().newton, 0) << what << ": the lease did not survive";
    }
    trial.expect_the_limits(what);
  });
  EXPECT_GT(with_force, kTrialCount * 9 / 10);
}

}  // namespace
}  // namespace rtpm::gvd
