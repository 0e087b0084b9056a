#include "rtpm/device_serial/session.hpp"

#include <gtest/gtest.h>

#include <memory>
#include <tuple>

#include "serial_model.hpp"

/// The conversation with a model of a board, on a simulated time line.
namespace rtpm::device_serial {
namespace {

using std::chrono::milliseconds;
using test::ScriptedSerialPort;
using test::SerialFault;
using test::SerialModel;

constexpr Duration kPeriod = milliseconds{2};
constexpr SessionConfig kConfig{.period = kPeriod, .speed_baud = 1'000'000, .nonce = 77};

/// A model and its session, greeted unless a fault prevents it.
struct Bench {
  explicit Bench(SerialFault fault = SerialFault::kNone, std::uint64_t faulty_from = 0,
                 bool resets = false)
      : model(fault, faulty_from), port(model, resets), session(port, kConfig) {}

  bool greet() {
    const auto board = session.greet();
    if (!board) return false;
    session.begin();
    return true;
  }
  /// Cycles for `span`, with a new request in each; false if the board is gone before.
  bool run(Duration span, float newton_metre, float lamp = 0) {
    const MonotonicTime end = port.now() + span;
    while (port.now() < end) {
      Request request{.number = ++number, .is_on = true, .time_left = milliseconds{30}};
      request.efforts[0] = newton_metre;
      request.outputs[0] = lamp;
      const MonotonicTime next = port.now() + kPeriod;
      while (port.now() < next) {
        if (!session.step(request, kPeriod / 4)) return false;
      }
      ++cycle_count;
    }
    return true;
  }
  /// Advances the board's own time, without the host.
  void wait(Duration span) {
    const MonotonicTime end = model.now() + span;
    for (MonotonicTime now = model.now(); now < end; now += milliseconds{1})
      model.advance(now);
  }

  SerialModel model;
  ScriptedSerialPort port;
  Session session;
  std::uint64_t number = 0;
  std::uint64_t cycle_count = 0;
};

TEST(SerialSession, CommandsInEachCycleAndTakesTheNewestState) {
  Bench bench;
  ASSERT_TRUE(bench.greet());
  ASSERT_TRUE(bench.run(milliseconds{100}, 0.05F, 1));
  EXPECT_EQ(bench.model.effort(), 0.05F);
  EXPECT_EQ(bench.model.lamp(), 1);
  const Report before = bench.session.report();
  EXPECT_EQ(before.state.efforts[0], 0.05F);
  EXPECT_NEAR(static_cast<double>(before.state_count), static_cast<double>(bench.cycle_count), 2);
  EXPECT_FALSE(before.is_late);
  bench.model.set_position(0.5F);
  ASSERT_TRUE(bench.run(2 * kPeriod, 0.05F));
  EXPECT_EQ(bench.session.report().state.positions[0], 0.5F);
  EXPECT_GT(bench.session.report().board_time, before.board_time);
}

TEST(SerialSession, WaitsForABoardThatItsPortResets) {
  Bench bench(SerialFault::kNone, 0, true);
  const MonotonicTime begin = bench.port.now();
  ASSERT_TRUE(bench.greet());
  EXPECT_GE(bench.port.now() - begin, SerialModel::kBootTime);
  EXPECT_LE(bench.port.now() - begin, SerialModel::kBootTime + milliseconds{50})
      << "at its announcement, not at the next hello";
  EXPECT_TRUE(bench.run(milliseconds{100}, 0.05F));
}

TEST(SerialSession, CountsEdgesOfStatesThatWereOvertaken) {
  Bench bench;
  ASSERT_TRUE(bench.greet());
  ASSERT_TRUE(bench.run(milliseconds{20}, 0));
  for (const bool is_pressed : {true, false, true}) {
    bench.model.press(is_pressed);
    ASSERT_TRUE(bench.run(milliseconds{10}, 0));
  }
  EXPECT_EQ(bench.session.report().button_edges[0], 3);
  EXPECT_EQ(bench.session.report().state.buttons, 1);
}

TEST(SerialSession, UnwrapsTheBoardsClock) {
  Bench bench;
  ASSERT_TRUE(bench.greet());
  ASSERT_TRUE(bench.run(milliseconds{10}, 0));
  const Report before = bench.session.report();
  // The board counts microseconds in 32 bits.
  const MonotonicTime wrap{std::chrono::microseconds{std::int64_t{1} << 32}};
  ASSERT_GT(wrap, bench.port.now());
  bench.model.advance(wrap - milliseconds{4});
  ScriptedSerialPort port(bench.model);
  Session session(port, kConfig);
  ASSERT_TRUE(session.greet());
  session.begin();
  Duration last{0};
  for (int i = 0; i < 40; ++i) {
    ASSERT_TRUE(session.step({}, milliseconds{1}));
    EXPECT_GE(session.report().board_time, last);
    last = session.report().board_time;
  }
  EXPECT_GT(port.now(), wrap);
  EXPECT_EQ(before.counters.corrupt, 0u);
}

TEST(SerialSession, EndsARequestThatIsNotRenewed) {
  Bench bench;
  ASSERT_TRUE(bench.greet());
  ASSERT_TRUE(bench.run(milliseconds{50}, 0.1F, 1));
  Request stale{.number = bench.number, .is_on = true, .time_left = milliseconds{30}};
  stale.efforts[0] = 0.1F;
  const MonotonicTime begin = bench.port.now();
  while (bench.model.effort() != 0) {
    ASSERT_TRUE(bench.session.step(stale, milliseconds{1}));
    ASSERT_LE(bench.port.now() - begin, milliseconds{40});
  }
  EXPECT_EQ(bench.model.lamp(), 0);
  for (int i = 0; i < 100; ++i) {
    ASSERT_TRUE(bench.session.step(stale, milliseconds{1}));
    ASSERT_EQ(bench.model.effort(), 0);
  }
  EXPECT_FALSE(bench.session.report().is_late) << "states go on";
}

TEST(SerialSession, TheBoardsWatchdogEndsTheEffortOfAHostThatDies) {
  Bench bench;
  ASSERT_TRUE(bench.greet());
  ASSERT_TRUE(bench.run(milliseconds{50}, 0.1F, 1));
  EXPECT_EQ(bench.model.effort(), 0.1F);
  bench.wait(milliseconds{25});
  EXPECT_EQ(bench.model.effort(), 0.1F) << "within the 30 ms of the command";
  bench.wait(milliseconds{10});
  EXPECT_EQ(bench.model.effort(), 0);
  EXPECT_EQ(bench.model.lamp(), 0);
  ASSERT_TRUE(bench.session.step({.number = 1'000'000}, milliseconds{1}));
}

TEST(SerialSession, StopSwitchesOffAtOnce) {
  Bench bench;
  ASSERT_TRUE(bench.greet());
  ASSERT_TRUE(bench.run(milliseconds{50}, 0.1F, 1));
  const MonotonicTime begin = bench.port.now();
  bench.session.stop();
  EXPECT_EQ(bench.model.effort(), 0);
  EXPECT_LE(bench.port.now() - begin, milliseconds{5}) << "it does not wait for the watchdog";
}

TEST(SerialSession, NeverHasMoreThanTwoCommandsUnanswered) {
  Bench bench(SerialFault::kDeaf, 10);
  ASSERT_TRUE(bench.greet());
  ASSERT_TRUE(bench.run(milliseconds{60}, 0));
  const std::uint64_t sent = bench.model.host_frame_count();
  // The session sends two at once, and two more each time it gives up on an answer.
  EXPECT_LE(sent, 10u + 2 + 2 * (60 / 10));
  EXPECT_GT(bench.session.report().counters.unanswered, 0u);
}

TEST(SerialSession, SaysWhyABoardDoesNotAnswer) {
  const auto why = [](SerialFault fault) {
    Bench bench(fault, 0);
    const MonotonicTime begin = bench.port.now();
    const auto board = bench.session.greet();
    EXPECT_LE(bench.port.now() - begin, kGreetingMax + milliseconds{20});
    return board ? "" : board.error().text();
  };
  EXPECT_NE(why(SerialFault::kSilent).find("does not answer"), std::string::npos);
  EXPECT_NE(why(SerialFault::kDeaf).find("does not answer"), std::string::npos);
  EXPECT_NE(why(SerialFault::kStuck).find("does not answer"), std::string::npos);
  EXPECT_NE(why(SerialFault::kGarbage).find("speed"), std::string::npos);
  EXPECT_NE(why(SerialFault::kWrongChecksum).find("speed"), std::string::npos);
  EXPECT_NE(why(SerialFault::kWrongVersion).find("another version"), std::string::npos);
  EXPECT_NE(why(SerialFault::kWrongSize).find("ends too early"), std::string::npos);
  EXPECT_NE(why(SerialFault::kUnplugged).find("unplugged"), std::string::npos);
}

/// The fate of a session in which a fault begins.
enum class Outcome { kGoesOn, kEnds };

Outcome outcome_of(SerialFault fault) {
  switch (fault) {
    case SerialFault::kSilent:
    case SerialFault::kDeaf:
    case SerialFault::kGarbage:
    case SerialFault::kFlippedBit:
    case SerialFault::kTruncated:
    case SerialFault::kWrongVersion:
    case SerialFault::kWrongChecksum:
    case SerialFault::kWrongLength:
    case SerialFault::kWrongSize:
    case SerialFault::kNotFinite:
    case SerialFault::kReset:
    case SerialFault::kResetUnnoticed:
    case SerialFault::kStuck:
    case SerialFault::kUnplugged:
      return Outcome::kEnds;
    default:
      return Outcome::kGoesOn;
  }
}

using FaultAtStep = std::tuple<int, std::uint64_t>;

class SerialSessionFaults : public ::testing::TestWithParam<FaultAtStep> {
 protected:
  SerialFault fault_ = static_cast<SerialFault>(std::get<0>(GetParam()));
  Bench bench_{fault_, std::get<1>(GetParam())};
};

/// A fault starting at each frame: the session ends or goes on within a bounded time, the board's
/// effort stays within its limit and ends at zero, and the session reports no invented value.
TEST_P(SerialSessionFaults, EndInZeroEffort) {
  const MonotonicTime begin = bench_.port.now();
  if (!bench_.greet()) {
    EXPECT_EQ(outcome_of(fault_), Outcome::kEnds);
    EXPECT_LE(bench_.port.now() - begin, kGreetingMax + milliseconds{20});
    EXPECT_EQ(bench_.model.greatest_effort(), 0);
    return;
  }
  const MonotonicTime greeted = bench_.port.now();
  const bool lives = bench_.run(std::chrono::seconds{2}, 0.1F, 1);
  // After the greeting a reset at the hello does not affect the session.
  const bool is_before = bench_.port.now() - begin > SerialModel::kBootTime &&
                         greeted - begin >= SerialModel::kBootTime;
  EXPECT_EQ(lives, is_before || outcome_of(fault_) == Outcome::kGoesOn);
  EXPECT_LE(bench_.port.now() - greeted, milliseconds{lives ? 2100 : 600}) << "bounded";
  const Report report = bench_.session.report();
  EXPECT_LE(std::abs(report.state.positions[0]), 0.1F);
  EXPECT_LE(std::abs(report.state.efforts[0]), 0.125F);
  EXPECT_LE(bench_.model.greatest_effort(), 0.1F);
  bench_.session.stop();
  // If the board no longer listens, its watchdog ends the effort.
  bench_.wait(Session::kRequestMax + milliseconds{1});
  EXPECT_EQ(bench_.model.effort(), 0);
  EXPECT_EQ(bench_.model.lamp(), 0);
}

std::string name_of(const testing::TestParamInfo<FaultAtStep>& test) {
  return std::string(to_string(static_cast<SerialFault>(std::get<0>(test.param)))) + "AtFrame" +
         std::to_string(std::get<1>(test.param));
}

INSTANTIATE_TEST_SUITE_P(
    All, SerialSessionFaults,
    ::testing::Combine(::testing::Range(1, static_cast<int>(test::kLastSerialFault) + 1),
                       ::testing::Values(0, 1, 2, 3, 5, 50)),
    name_of);

TEST(SerialSessionCounters, NameWhatWasWrong) {
  const auto counters = [](SerialFault fault) {
    Bench bench(fault, 5);
    EXPECT_TRUE(bench.greet());
    static_cast<void>(bench.run(milliseconds{200}, 0));
    return bench.session.report().counters;
  };
  const LineCounters none = counters(SerialFault::kNone);
  EXPECT_EQ(none.corrupt + none.lost + none.duplicate + none.stale + none.unanswered, 0u);
  EXPECT_GT(counters(SerialFault::kNoise).corrupt, 10u);
  EXPECT_GT(counters(SerialFault::kFlippedBit).corrupt, 10u);
  EXPECT_GT(counters(SerialFault::kNotFinite).corrupt, 10u);
  EXPECT_GT(counters(SerialFault::kWrongVersion).corrupt, 10u);
  EXPECT_GT(counters(SerialFault::kTruncated).corrupt, 5u);
  EXPECT_GT(counters(SerialFault::kDuplicate).duplicate, 50u);
  EXPECT_GT(counters(SerialFault::kStale).stale, 50u);
  EXPECT_GT(counters(SerialFault::kLost).lost, 20u);
  EXPECT_GT(counters(SerialFault::kSilent).unanswered, 10u);
  const LineCounters split = counters(SerialFault::kSplit);
  EXPECT_EQ(split.corrupt + split.lost + split.stale, 0u);
}

TEST(SerialSession, IsLateWhileStatesAreAndThenNotAnyMore) {
  Bench bench(SerialFault::kLate, 20);
  ASSERT_TRUE(bench.greet());
  ASSERT_TRUE(bench.run(milliseconds{30}, 0));
  EXPECT_FALSE(bench.session.report().is_late);
  ASSERT_TRUE(bench.run(milliseconds{50}, 0));
  EXPECT_TRUE(bench.session.report().is_late);
  bench.model.set_fault(SerialFault::kNone);
  ASSERT_TRUE(bench.run(milliseconds{200}, 0));
  EXPECT_FALSE(bench.session.report().is_late);
}

TEST(SerialSession, ABoardThatStartedAgainIsGoneAtOnce) {
  Bench bench;
  ASSERT_TRUE(bench.greet());
  ASSERT_TRUE(bench.run(milliseconds{30}, 0.1F));
  bench.model.set_boot_time(milliseconds{100});
  bench.model.set_fault_now(SerialFault::kReset);
  const MonotonicTime begin = bench.port.now();
  EXPECT_FALSE(bench.run(std::chrono::seconds{1}, 0.1F));
  EXPECT_LE(bench.port.now() - begin, milliseconds{110}) << "at its announcement";
  EXPECT_EQ(bench.model.effort(), 0);
}

}  // namespace
}  // namespace rtpm::device_serial
