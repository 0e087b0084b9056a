#include "rtpm/safety/filter.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <random>

namespace rtpm::gvd {
namespace {

using driver::Fault;
using driver::Vector3;
using driver::Wrench;
using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

double length(const Vector3& v) {
  return std::hypot(v.x, v.y, v.z);
}

MonotonicTime at(Duration time) {
  return MonotonicTime{seconds{1000}} + time;
}

SafetyConfig config() {
  SafetyConfig config;
  config.force_newton_max = 9;
  config.torque_newton_metre_max = 0.5;
  return config;
}

/// A configuration without soft start and rate limit, to test one rule at a time.
SafetyConfig plain_config() {
  SafetyConfig plain = config();
  plain.soft_start = Duration{0};
  plain.force_newton_per_s_max = 1e12;
  plain.torque_newton_metre_per_s_max = 1e12;
  return plain;
}

WrenchCommand force(double x, double y, double z, Duration received, Duration hold) {
  return {{{x, y, z}, {}}, at(received), at(received + hold)};
}

/// A filter whose last step was one millisecond before at(0).
SafetyFilter stepped(const SafetyConfig& config) {
  SafetyFilter filter{config};
  EXPECT_EQ(filter.step(at(milliseconds{-1}), std::nullopt), Wrench{});
  return filter;
}

/// Runs the filter once per millisecond with an endless command; returns the last output.
Wrench settle(SafetyFilter& filter, const Wrench& request, int& ms, int count) {
  Wrench output;
  for (int i = 0; i < count; ++i, ++ms) {
    const Duration now = milliseconds{ms};
    output = filter.step(at(now), WrenchCommand{request, at(now), at(now + milliseconds{10})});
  }
  return output;
}

TEST(Safety, LetsAModestCommandThroughUnchanged) {
  SafetyFilter filter{config()};
  int ms = 0;
  const Wrench request{{1, -2, 3}, {0.1, 0.2, -0.1}};
  EXPECT_EQ(settle(filter, request, ms, 400), request);
  EXPECT_TRUE(filter.faults().empty()) << driver::to_text(filter.faults());
}

TEST(Safety, ClampsForceAndTorqueAndKeepsTheirDirections) {
  SafetyFilter filter{plain_config()};
  int ms = 0;
  const Wrench output = settle(filter, {{30, 40, 0}, {0, -6, 8}}, ms, 3);
  EXPECT_NEAR(output.force_newton.x, 5.4, 1e-12);
  EXPECT_NEAR(output.force_newton.y, 7.2, 1e-12);
  EXPECT_NEAR(output.torque_newton_metre.y, -0.3, 1e-12);
  EXPECT_NEAR(output.torque_newton_metre.z, 0.4, 1e-12);
  EXPECT_TRUE(filter.faults().has(Fault::kForceClamped));
  EXPECT_EQ(filter.counters().clamped_count, 3u);
}

TEST(Safety, RisesNoFasterThanTheRateByTheTimeThatReallyWentBy) {
  SafetyConfig slow = plain_config();
  slow.force_newton_per_s_max = 100;
  SafetyFilter filter{slow};
  const auto command = [](Duration now) { return force(8, 0, 0, now, milliseconds{10}); };
  static_cast<void>(filter.step(at(Duration{0}), command(Duration{0})));
  EXPECT_NEAR(filter.step(at(milliseconds{1}), command(milliseconds{1})).force_newton.x, 0.1,
              1e-12);
  EXPECT_TRUE(filter.faults().has(Fault::kForceRateLimited));
  EXPECT_NEAR(filter.step(at(milliseconds{5}), command(milliseconds{5})).force_newton.x, 0.5,
              1e-12);
  // After a pause of the thread the force does not jump: at most ten milliseconds count.
  EXPECT_NEAR(filter.step(at(seconds{2}), command(seconds{2})).force_newton.x, 1.5, 1e-12);
}

TEST(Safety, SoftStartRisesFromNothingToAll) {
  SafetyConfig soft = plain_config();
  soft.soft_start = milliseconds{200};
  SafetyFilter filter{soft};
  int ms = 0;
  EXPECT_EQ(length(settle(filter, {{4, 0, 0}, {}}, ms, 1).force_newton), 0) << "from nothing";
  EXPECT_NEAR(settle(filter, {{4, 0, 0}, {}}, ms, 100).force_newton.x, 2, 1e-9) << "half way";
  EXPECT_TRUE(filter.faults().has(Fault::kSoftStart));
  EXPECT_NEAR(settle(filter, {{4, 0, 0}, {}}, ms, 101).force_newton.x, 4, 1e-12);
  EXPECT_FALSE(filter.faults().has(Fault::kSoftStart));
}

TEST(Safety, AnotherClientsCommandsCountOnlyAfterACycleWithoutForce) {
  for (const int ramp_ms : {0, 20}) {
    SafetyConfig config = plain_config();
    config.ramp = milliseconds{ramp_ms};
    config.soft_start = milliseconds{200};
    SafetyFilter filter{config};
    int ms = 0;
    static_cast<void>(settle(filter, {{4, 0, 0}, {0, 0.3, 0}}, ms, 300));
    filter.change_client();
    double newton = 4;
    int zero_at_ms = -1;
    for (int i = 0; i <= ramp_ms; ++i) {
      const Wrench output = settle(filter, {{-8, 0, 0}, {0, 0.5, 0}}, ms, 1);
      EXPECT_GE(output.force_newton.x, 0) << "the new client's sign is not seen";
      EXPECT_LE(output.force_newton.x, newton);
      EXPECT_LE(output.torque_newton_metre.y, 0.3);
      EXPECT_NEAR(output.force_newton.x, ramp_ms == 0 ? 0 : 4.0 * (ramp_ms - i) / ramp_ms, 1e-9);
      EXPECT_FALSE(filter.faults().has(Fault::kCommandLost)) << "it was no loss";
      newton = output.force_newton.x;
      if (output == Wrench{}) zero_at_ms = i;
    }
    EXPECT_EQ(zero_at_ms, ramp_ms) << "off within the ramp";
    EXPECT_NEAR(settle(filter, {{-8, 0, 0}, {}}, ms, 100).force_newton.x, -4, 0.1) << "soft start";
  }
}

TEST(Safety, AChangeOfClientTakesOneCycleWithoutForceEvenFromNone) {
  SafetyFilter filter = stepped(plain_config());
  int ms = 0;
  filter.change_client();
  EXPECT_EQ(settle(filter, {{4, 0, 0}, {}}, ms, 1), Wrench{});
  EXPECT_EQ(settle(filter, {{4, 0, 0}, {}}, ms, 1).force_newton.x, 4);
}

TEST(Safety, ManyChangesOfClientDoNotMakeTheRampLonger) {
  SafetyConfig config = plain_config();
  config.ramp = milliseconds{20};
  SafetyFilter filter{config};
  int ms = 0;
  static_cast<void>(settle(filter, {{4, 0, 0}, {}}, ms, 10));
  for (int i = 0; i <= 20; ++i) {
    filter.change_client();
    static_cast<void>(settle(filter, {{-4, 0, 0}, {}}, ms, 1));
  }
  EXPECT_TRUE(filter.is_off());
}

TEST(Watchdog, HoldsThenFallsInAStraightLineThenIsOff) {
  SafetyConfig plain = plain_config();
  plain.ramp = milliseconds{20};
  SafetyFilter filter = stepped(plain);
  const WrenchCommand only = force(0, 0, 6, Duration{0}, milliseconds{10});
  for (int ms = 0; ms <= 50; ++ms) {
    const double newton = filter.step(at(milliseconds{ms}), only).force_newton.z;
    const double wanted = ms < 10 ? 6.0 : ms < 30 ? 6.0 * (30 - ms) / 20.0 : 0.0;
    EXPECT_NEAR(newton, wanted, 1e-9) << "at " << ms << " ms";
    EXPECT_EQ(filter.faults().has(Fault::kCommandLost), ms >= 10) << "at " << ms << " ms";
  }
  EXPECT_EQ(filter.counters().lost_count, 1u) << "one loss, however many cycles it lasts";
  EXPECT_EQ(filter.zero_at(), at(milliseconds{30}));
}

TEST(Watchdog, ShortensAHoldThatIsTooLong) {
  SafetyConfig plain = plain_config();
  plain.hold_max = milliseconds{50};
  for (const MonotonicTime deadline : {at(seconds{3600}), kNever}) {
    SafetyFilter filter = stepped(plain);
    const WrenchCommand only{{{0, 0, 6}, {}}, at(Duration{0}), deadline};
    EXPECT_GT(filter.step(at(milliseconds{49}), only).force_newton.z, 0);
    EXPECT_EQ(filter.step(at(milliseconds{70}), only).force_newton.z, 0);
  }
}

TEST(Watchdog, ForceEndsWithTheLease) {
  SafetyFilter filter = stepped(plain_config());
  const WrenchCommand only = force(6, 0, 0, Duration{0}, milliseconds{100});
  EXPECT_EQ(filter.step(at(Duration{0}), only).force_newton.x, 6);
  // The client released the lease: the rest of the command's life does not matter.
  EXPECT_GT(filter.step(at(milliseconds{1}), std::nullopt).force_newton.x, 5);
  EXPECT_NEAR(filter.step(at(milliseconds{11}), std::nullopt).force_newton.x, 3, 1e-9);
  EXPECT_EQ(filter.step(at(milliseconds{21}), std::nullopt).force_newton.x, 0);
  EXPECT_FALSE(filter.faults().has(Fault::kCommandLost)) << "that was in order";
  EXPECT_EQ(filter.counters().lost_count, 0u);
}

TEST(Watchdog, AShortGapGoesOnSoftlyFromWhereTheForceIs) {
  SafetyConfig soft = config();
  SafetyFilter filter{soft};
  int ms = 0;
  settle(filter, {{0, 4, 0}, {}}, ms, 400);
  const WrenchCommand last = force(0, 4, 0, milliseconds{ms}, Duration{0});
  ms += 10;
  const double halved = filter.step(at(milliseconds{ms}), last).force_newton.y;
  EXPECT_NEAR(halved, 2, 0.11);
  ++ms;
  const double next = settle(filter, {{0, 4, 0}, {}}, ms, 1).force_newton.y;
  EXPECT_NEAR(next, halved, 0.1) << "no jump";
  EXPECT_FALSE(filter.faults().has(Fault::kCommandLost));
  EXPECT_TRUE(filter.faults().has(Fault::kSoftStart));
  EXPECT_NEAR(settle(filter, {{0, 4, 0}, {}}, ms, 200).force_newton.y, 4, 1e-9);
}

TEST(Safety, ANonFiniteNumberEndsTheForceUntilRecovery) {
  for (const double bad : {kNan, kInfinity, -kInfinity}) {
    for (int component = 0; component < 6; ++component) {
      SafetyFilter filter{plain_config()};
      int ms = 0;
      const Wrench good{{1, 2, 3}, {0.1, 0, 0}};
      EXPECT_EQ(settle(filter, good, ms, 3), good);
      Wrench request = good;
      double* const fields[] = {&request.force_newton.x,        &request.force_newton.y,
                                &request.force_newton.z,        &request.torque_newton_metre.x,
                                &request.torque_newton_metre.y, &request.torque_newton_metre.z};
      *fields[component] = bad;
      EXPECT_EQ(settle(filter, request, ms, 1), Wrench{}) << "at once, without a ramp";
      EXPECT_TRUE(filter.faults().has(Fault::kCommandNotFinite));
      EXPECT_EQ(settle(filter, good, ms, 500), Wrench{}) << "good commands do not heal it";
      EXPECT_EQ(filter.counters().not_finite_count, 1u);
      filter.recover();
      EXPECT_EQ(settle(filter, good, ms, 3), good);
      EXPECT_TRUE(filter.faults().empty());
    }
  }
}

/// A hostile client, with extreme values, lifetimes and pauses from a seed.
class HostileSafety : public ::testing::TestWithParam<unsigned> {};

double wild_number(std::mt19937& random) {
  constexpr std::array kWild{0.0, -0.0, 1e-320, 1e308, -1e308,    1.7e308,
                             9.0, -9.0, 1e-9,   kNan,  kInfinity, -kInfinity};
  if (random() % 3 == 0) return kWild[random() % kWild.size()];
  return std::uniform_real_distribution<double>(-20, 20)(random);
}

TEST_P(HostileSafety, NothingGetsTheForceBeyondItsLimitsOrPastItsBound) {
  std::mt19937 random(GetParam());
  SafetyFilter filter{config()};
  const SafetyConfig& limits = filter.config();
  MonotonicTime now = at(Duration{0});
  std::optional<WrenchCommand> newest;
  MonotonicTime bound = now;
  Wrench before;
  for (int cycle = 0; cycle < 5000; ++cycle) {
    const Duration elapsed = random() % 50 == 0 ? Duration{milliseconds{random() % 300}}
                                                : Duration{microseconds{random() % 2000}};
    now += elapsed;
    if (random() % 4 == 0) {
      newest = WrenchCommand{{{wild_number(random), wild_number(random), wild_number(random)},
                              {wild_number(random), wild_number(random), wild_number(random)}},
                             now,
                             random() % 20 == 0 ? kNever : now + milliseconds{random() % 200}};
    } else if (random() % 40 == 0) {
      newest.reset();
    }
    if (random() % 30 == 0) filter.recover();
    if (newest)
      bound = std::min(newest->deadline, newest->received + limits.hold_max) + limits.ramp;
    if (!newest) bound = std::min(bound, now + limits.ramp);

    const Wrench output = filter.step(now, newest);
    ASSERT_TRUE(std::isfinite(length(output.force_newton)));
    ASSERT_LE(length(output.force_newton), limits.force_newton_max * (1 + 1e-12));
    ASSERT_LE(length(output.torque_newton_metre), limits.torque_newton_metre_max * (1 + 1e-12));
    if (now >= bound) {
      ASSERT_EQ(output, Wrench{}) << "cycle " << cycle;
    }
    const double rise = length(output.force_newton) - length(before.force_newton);
    ASSERT_LE(rise, limits.force_newton_per_s_max * 0.010 + 1e-9);
    ASSERT_LE(rise, limits.force_newton_per_s_max * std::chrono::duration<double>(elapsed).count() +
                        1e-9);
    before = output;
  }
}

INSTANTIATE_TEST_SUITE_P(Seeds, HostileSafety, ::testing::Range(1u, 21u));

TEST(HostileTime, AClockThatGoesBackChangesNothing) {
  SafetyFilter filter{config()};
  int ms = 100;
  settle(filter, {{4, 0, 0}, {}}, ms, 400);
  const WrenchCommand last = force(4, 0, 0, milliseconds{ms}, milliseconds{10});
  const double before = filter.step(at(milliseconds{ms}), last).force_newton.x;
  EXPECT_EQ(filter.step(at(milliseconds{0}), last).force_newton.x, before);
  EXPECT_EQ(filter.step(at(milliseconds{ms + 30}), last).force_newton.x, 0) << "nor the bound";
}

TEST(SafetyConfig, TakesTheDevicesLimitsWithEveryMechanismOn) {
  driver::Descriptor device;
  device.limits.force_newton_max = 3.5;
  device.limits.stiffness_newton_per_m_max = 400;
  device.workspace = {{-0.1, -0.1, -0.1}, {0.1, 0.1, 0.1}};
  const SafetyConfig config = SafetyConfig::for_device(device);
  EXPECT_EQ(config.force_newton_max, 3.5);
  EXPECT_EQ(config.torque_newton_metre_max, 0);
  EXPECT_GT(config.power_watt_max, 0);
  EXPECT_GT(config.velocity_m_per_s_max, 0);
  EXPECT_GT(config.wall_newton_per_m, 0);
  EXPECT_GT(config.force_newton_continuous, 0);
  EXPECT_TRUE(config.has_passivity_guard);
  EXPECT_GT(config.passivity_newton_s_per_m_max, 0);
  EXPECT_TRUE(config.check());
}

TEST(SafetyConfig, NamesInvalidValues) {
  SafetyConfig bad = config();
  bad.force_newton_max = kNan;
  ASSERT_FALSE(bad.check());
  EXPECT_NE(bad.check().error().text().find("force_newton_max is nan"), std::string::npos);
  bad = config();
  bad.torque_newton_metre_per_s_max = -1;
  EXPECT_FALSE(bad.check());
  bad = config();
  bad.ramp = seconds{11};
  ASSERT_FALSE(bad.check());
  EXPECT_NE(bad.check().error().text().find("ramp"), std::string::npos);
}

TEST(Safety, ADeviceWithoutForceGetsNoForce) {
  SafetyFilter filter{SafetyConfig{}};
  int ms = 0;
  EXPECT_EQ(settle(filter, {{5, 5, 5}, {1, 1, 1}}, ms, 500), Wrench{});
}

}  // namespace
}  // namespace rtpm::gvd
