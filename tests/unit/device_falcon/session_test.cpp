#include "rtpm/device_falcon/session.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "faults.hpp"
#include "rtpm/device_falcon/start_up.hpp"
#include "scripted_falcon.hpp"

/// The cycle with a model of a unit, on the model's time line.
namespace rtpm::device_falcon {
namespace {

using driver::Vector3;
using std::chrono::milliseconds;
using std::chrono::seconds;
using test::FalconFault;
using test::FalconModel;
using test::FalconModelConfig;
using test::FalconStep;
using test::ScriptedFalcon;

constexpr Duration kPatience = milliseconds{1};
constexpr LegCounts kPush{-300, -300, -300};

double distance(const Vector3& a, const Vector3& b) {
  return std::hypot(a.x - b.x, a.y - b.y, a.z - b.z);
}

/// A unit that has started, and its session.
struct Cycle {
  explicit Cycle(const FalconModelConfig& config = {})
      : model(std::make_shared<FalconModel>(config)), transport(model) {
    EXPECT_TRUE(start_up(transport, {}));
    session.emplace(transport);
  }

  /// Steps for `span` of the unit's time, with new requests; false if the unit is gone before.
  bool run(const LegCounts& counts, Duration span) {
    const MonotonicTime end = model->now() + span;
    while (model->now() < end) {
      const ForceRequest request{++number, counts, model->now() + milliseconds{20}};
      if (!session->step(request, kPatience)) return false;
    }
    return true;
  }

  std::shared_ptr<FalconModel> model;
  ScriptedFalcon transport;
  std::optional<Session> session;
  std::uint64_t number = 0;
};

TEST(FalconSession, KnowsWhereTheGripIs) {
  Cycle cycle;
  cycle.model->hold_at({0.01, -0.02, 0.015});
  ASSERT_TRUE(cycle.run({}, seconds{2}));
  const FalconState& state = cycle.session->state();
  EXPECT_TRUE(state.is_homed);
  EXPECT_LT(distance(state.position_m, cycle.model->position_m()), 1e-4);
  EXPECT_LT(distance(state.velocity_m_per_s, {}), 0.01);
  EXPECT_NEAR(static_cast<double>(state.report_count), 2000, 200) << "one packet per millisecond";
  EXPECT_EQ(state.corrupt_count, 0u);
}

TEST(FalconSession, KnowsHowFastTheGripMoves) {
  Cycle cycle;
  ASSERT_TRUE(cycle.run({}, milliseconds{200}));
  cycle.model->hold_at({0.03, 0, 0});
  ASSERT_TRUE(cycle.run({}, milliseconds{60}));
  const Vector3 before = cycle.model->position_m();
  ASSERT_TRUE(cycle.run({}, milliseconds{8}));
  const double speed = (cycle.model->position_m().x - before.x) / 0.008;
  EXPECT_GT(speed, 0.05);
  EXPECT_NEAR(cycle.session->state().velocity_m_per_s.x, speed, 0.25 * speed);
}

TEST(FalconSession, PassesForceOnToTheUnit) {
  Cycle cycle;
  ASSERT_TRUE(cycle.run(kPush, milliseconds{300}));
  EXPECT_EQ(cycle.model->motor_counts(), kPush);
  EXPECT_EQ(cycle.model->leds(), kGreenLedFlag);
  EXPECT_GT(cycle.model->position_m().z, 0.126) << "towards the operator";
  ASSERT_TRUE(cycle.run({}, milliseconds{50}));
  EXPECT_FALSE(cycle.model->has_force());
  EXPECT_EQ(cycle.model->leds(), kBlueLedFlag);
}

TEST(FalconSession, HasNoForceUntilTheUnitIsHomed) {
  Cycle cycle({.is_homed = false});
  for (const std::uint8_t homed : std::array<std::uint8_t, 3>{0b000, 0b001, 0b011}) {
    cycle.model->set_homed(homed);
    ASSERT_TRUE(cycle.run(kPush, milliseconds{200}));
    EXPECT_FALSE(cycle.model->has_force());
    EXPECT_FALSE(cycle.session->state().is_homed);
    EXPECT_EQ(cycle.model->leds(), kRedLedFlag);
  }
  cycle.model->set_homed(0b111);
  ASSERT_TRUE(cycle.run(kPush, milliseconds{200}));
  EXPECT_TRUE(cycle.session->state().is_homed);
  EXPECT_TRUE(cycle.model->has_force());
  cycle.model->set_homed(0b101);
  ASSERT_TRUE(cycle.run(kPush, milliseconds{5}));
  EXPECT_FALSE(cycle.model->has_force());
  EXPECT_FALSE(cycle.session->state().is_homed);
}

TEST(FalconSession, EndsTheForceAtTheDeadline) {
  Cycle cycle;
  ASSERT_TRUE(cycle.run(kPush, milliseconds{100}));
  const ForceRequest last{++cycle.number, kPush, cycle.model->now() + milliseconds{10}};
  const MonotonicTime begin = cycle.model->now();
  while (cycle.model->has_force() && cycle.model->now() < begin + seconds{1}) {
    ASSERT_TRUE(cycle.session->step(last, kPatience));
  }
  EXPECT_LE(cycle.model->now() - begin, milliseconds{13});
  EXPECT_GE(cycle.model->now() - begin, milliseconds{9});
}

TEST(FalconSession, EndsTheForceOfARequestThatIsNotRenewed) {
  Cycle cycle;
  const ForceRequest last{1, kPush, kNever};
  const MonotonicTime begin = cycle.model->now();
  while (cycle.model->now() < begin + Session::kRequestLife + milliseconds{5}) {
    ASSERT_TRUE(cycle.session->step(last, kPatience));
  }
  EXPECT_FALSE(cycle.model->has_force());
  EXPECT_GT(cycle.model->packet_count(), 50u);
}

TEST(FalconSession, StopsWithoutForce) {
  Cycle cycle;
  ASSERT_TRUE(cycle.run(kPush, milliseconds{100}));
  ASSERT_TRUE(cycle.model->has_force());
  cycle.session->stop();
  EXPECT_FALSE(cycle.model->has_force());
  EXPECT_EQ(cycle.model->leds(), kRedLedFlag);
}

TEST(FalconSession, CountsEachPressAndNoneOfADamagedPacket) {
  Cycle cycle;
  ASSERT_TRUE(cycle.run({}, milliseconds{20}));
  for (int press = 0; press < 3; ++press) {
    cycle.model->press(0b0101);
    ASSERT_TRUE(cycle.run({}, milliseconds{10}));
    EXPECT_EQ(cycle.session->state().buttons, 0b0101);
    cycle.model->press(0);
    ASSERT_TRUE(cycle.run({}, milliseconds{10}));
  }
  const auto edges = cycle.session->state().button_edges;
  EXPECT_EQ(edges, (std::array<std::uint16_t, kButtonCount>{6, 0, 6, 0}));
  cycle.model->set_plan({FalconFault::kStuckButton, FalconStep::kPacket, 5, 1});
  ASSERT_TRUE(cycle.run({}, milliseconds{20}));
  EXPECT_EQ(cycle.session->state().button_edges, edges) << "one packet is no press";
}

TEST(FalconSession, DropsOnePacketThatLeapsAndItsForce) {
  Cycle cycle;
  ASSERT_TRUE(cycle.run(kPush, milliseconds{100}));
  cycle.model->set_plan({FalconFault::kEncoderJump, FalconStep::kPacket, 10, 1});
  bool was_without_force = false;
  for (int i = 0; i < 30; ++i) {
    ASSERT_TRUE(cycle.run(kPush, milliseconds{1}));
    EXPECT_LT(distance(cycle.session->state().position_m, cycle.model->position_m()), 1e-3);
    was_without_force = was_without_force || !cycle.model->has_force();
  }
  EXPECT_EQ(cycle.session->state().corrupt_count, 1u);
  EXPECT_TRUE(was_without_force);
  EXPECT_TRUE(cycle.model->has_force()) << "and goes on";
}

TEST(FalconSession, SaysLateAndRepeatsAPacketWithoutAnswer) {
  Cycle cycle;
  ASSERT_TRUE(cycle.run({}, milliseconds{50}));
  EXPECT_FALSE(cycle.session->is_late());
  cycle.model->set_plan({FalconFault::kStatusOnly, FalconStep::kPacket, 0, 1});
  ASSERT_TRUE(cycle.run({}, milliseconds{9}));
  EXPECT_TRUE(cycle.session->is_late());
  ASSERT_TRUE(cycle.run({}, milliseconds{20}));
  EXPECT_FALSE(cycle.session->is_late());
}

TEST(FalconSession, KeepsPaceWithAClockThatDrifts) {
  for (const double drift_ppm : {-200.0, 200.0}) {
    Cycle cycle({.drift_ppm = drift_ppm});
    for (int i = 0; i < 2000; ++i) {
      ASSERT_TRUE(cycle.run(kPush, milliseconds{1}));
      ASSERT_FALSE(cycle.session->is_late());
    }
    EXPECT_EQ(cycle.session->state().corrupt_count, 0u);
    EXPECT_TRUE(cycle.model->has_force());
  }
}

/// Whether a session survives a fault that does not end.
bool is_survived(FalconFault fault) {
  switch (fault) {
    case FalconFault::kNone:
    case FalconFault::kLate:
    case FalconFault::kSplit:
    case FalconFault::kGlued:
    case FalconFault::kHomedBitLost:
    case FalconFault::kStuckButton:
    case FalconFault::kTorqueIgnored:
      return true;
    default:
      return false;
  }
}

class FalconSessionFaults : public testing::TestWithParam<FalconFault> {
 protected:
  void expect_sound(const FalconState& state) {
    EXPECT_LT(distance(state.position_m, {0, 0, 0.125}), 0.06);
    EXPECT_LT(distance(state.velocity_m_per_s, {}), 3);
  }
  void expect_end_without_force(Cycle& cycle, bool is_reachable) {
    cycle.session->stop();
    if (is_reachable) {
      EXPECT_FALSE(cycle.model->has_force());
    }
    // Where the session could not end the force, the next contact does.
    cycle.model->set_plan({});
    cycle.model->plug_in();
    EXPECT_TRUE(start_up(cycle.transport, {}));
    EXPECT_FALSE(cycle.model->has_force());
  }
};

TEST_P(FalconSessionFaults, EndWithoutForce) {
  for (const std::uint64_t from : {0u, 1u, 9u, 40u}) {
    for (const std::uint64_t count : {std::uint64_t{1}, std::uint64_t{3}, test::kForGood}) {
      SCOPED_TRACE(testing::Message() << "from " << from << " count " << count);
      Cycle cycle;
      ASSERT_TRUE(cycle.run(kPush, milliseconds{50}));
      cycle.model->set_plan({GetParam(), FalconStep::kPacket, from, count});
      const MonotonicTime begin = cycle.model->now();
      bool lives = true;
      while (lives && cycle.model->now() < begin + milliseconds{400}) {
        lives = cycle.run(kPush, milliseconds{1});
        expect_sound(cycle.session->state());
      }
      const bool kills_at_once =
          GetParam() == FalconFault::kStall || GetParam() == FalconFault::kNoDevice;
      EXPECT_EQ(lives, is_survived(GetParam()) || (count != test::kForGood && !kills_at_once));
      EXPECT_LT(cycle.model->now() - begin, milliseconds{410});
      if (lives && count != test::kForGood) {
        EXPECT_TRUE(cycle.session->state().is_homed);
        EXPECT_TRUE(cycle.model->has_force()) << "goes on after it";
        EXPECT_FALSE(cycle.session->is_late());
      }
      expect_end_without_force(cycle, !(kills_at_once && count == test::kForGood) &&
                                          GetParam() != FalconFault::kNoDevice);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(All, FalconSessionFaults, testing::ValuesIn(test::all_faults()),
                         [](const auto& test) { return test::to_string(test.param); });

}  // namespace
}  // namespace rtpm::device_falcon
