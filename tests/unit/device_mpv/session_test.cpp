#include "rtpm/device_mpv/session.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "scripted_player.hpp"

/// The conversation with a model of mpv, on a simulated time line.
namespace rtpm::device_mpv {
namespace {

using std::chrono::milliseconds;
using test::PlayerFault;
using test::ScriptedPlayer;

constexpr Duration kPeriod = milliseconds{10};
constexpr Duration kPatience = kPeriod / 4;

/// Steps for `span` of the player's time; false if the player is gone before.
bool run(Session& session, ScriptedPlayer& player, const PlayerRequest& request, Duration span) {
  const MonotonicTime end = player.now() + span;
  while (player.now() < end) {
    if (!session.step(request, kPatience)) return false;
  }
  return true;
}

std::size_t count(const ScriptedPlayer& player, std::string_view words) {
  return static_cast<std::size_t>(std::ranges::count_if(
      player.commands(), [&](const std::string& command) { return command.starts_with(words); }));
}

TEST(MpvSession, OnlyPollsWithoutARequest) {
  ScriptedPlayer player;
  Session session(player, kPeriod);
  for (int i = 0; i < 50; ++i)
    ASSERT_TRUE(session.step(std::nullopt, kPatience));
  EXPECT_TRUE(player.commands().empty());
  EXPECT_GT(session.state().report_count, 0u);
}

TEST(MpvSession, SendsARateOnce) {
  ScriptedPlayer player;
  Session session(player, kPeriod);
  ASSERT_TRUE(run(session, player, {.rate = 2}, milliseconds{1000}));
  EXPECT_EQ(player.commands(),
            (std::vector<std::string>{"set_property play-dir forward", "set_property speed 2.0",
                                      "set_property pause false"}));
  EXPECT_NEAR(session.state().position_s, 2, 0.05);
  ASSERT_TRUE(run(session, player, {.rate = -2}, milliseconds{500}));
  EXPECT_NEAR(session.state().position_s, 1, 0.05);
  EXPECT_TRUE(session.state().is_backwards);
  ASSERT_TRUE(run(session, player, {.rate = 0}, milliseconds{500}));
  EXPECT_NEAR(session.state().position_s, 1, 0.05);
  EXPECT_TRUE(session.state().is_paused);
}

TEST(MpvSession, SeeksWhenTheTargetChanges) {
  ScriptedPlayer player;
  Session session(player, kPeriod);
  ASSERT_TRUE(run(session, player, {.seek_s = 7}, milliseconds{100}));
  ASSERT_TRUE(run(session, player, {.seek_s = 7}, milliseconds{100}));
  EXPECT_EQ(count(player, "seek 7.0 absolute+exact"), 1u);
  EXPECT_EQ(session.state().position_s, 7);
  ASSERT_TRUE(run(session, player, {.seek_s = -1}, milliseconds{20}));
  ASSERT_TRUE(run(session, player, {.seek_s = 7}, milliseconds{20}));
  EXPECT_EQ(count(player, "seek 7.0"), 2u) << "after 'nowhere' the same target is a new one";
}

TEST(MpvSession, SeeksToTheNewestTargetWhenASeekEnds) {
  ScriptedPlayer player;
  player.set_seek_time(milliseconds{50});
  Session session(player, kPeriod);
  for (int i = 1; i <= 100; ++i) {
    ASSERT_TRUE(run(session, player, {.seek_s = static_cast<float>(i) * 0.125F}, milliseconds{2}));
  }
  EXPECT_LE(count(player, "seek"), 5u) << "one at a time";
  ASSERT_TRUE(run(session, player, {.seek_s = 12.5F}, milliseconds{200}));
  EXPECT_EQ(session.state().position_s, 12.5);
}

TEST(MpvSession, SeeksAgainWhenAPlayerThatStillLoadsRefused) {
  ScriptedPlayer player(PlayerFault::kNothingLoaded);
  Session session(player, kPeriod);
  const PlayerRequest request{.rate = 0, .seek_s = 7};
  ASSERT_TRUE(run(session, player, request, milliseconds{500}));
  EXPECT_LE(count(player, "seek"), 51u) << "at most once per period";
  player.set_fault(PlayerFault::kNone);
  ASSERT_TRUE(run(session, player, request, milliseconds{50}));
  EXPECT_EQ(player.position_s(), 7);
  const std::size_t seek_count = count(player, "seek");
  ASSERT_TRUE(run(session, player, request, milliseconds{500}));
  EXPECT_EQ(count(player, "seek"), seek_count) << "taken once";
}

TEST(MpvSession, StatesThePictureShownAndNotTheTarget) {
  ScriptedPlayer player;
  player.set_seek_time(milliseconds{80});
  Session session(player, kPeriod);
  ASSERT_TRUE(run(session, player, {.seek_s = 9}, milliseconds{60}));
  EXPECT_EQ(session.state().position_s, 0);
  ASSERT_TRUE(run(session, player, {.seek_s = 9}, milliseconds{60}));
  EXPECT_EQ(session.state().position_s, 9);
}

TEST(MpvSession, PlaysOnAfterASeekFromTheEnd) {
  ScriptedPlayer player;
  Session session(player, kPeriod);
  ASSERT_TRUE(run(session, player, {.rate = 4}, std::chrono::seconds{6}));
  EXPECT_TRUE(session.state().is_paused) << "mpv pauses at the end";
  ASSERT_TRUE(run(session, player, {.rate = 4, .seek_s = 2}, milliseconds{500}));
  EXPECT_FALSE(session.state().is_paused);
  EXPECT_NEAR(session.state().position_s, 4, 0.1);
}

/// Every fault starting at each command: the session ends or goes on within a bounded time, and
/// never reports a number that the player did not send.
TEST(MpvSession, SurvivesEachFaultAtEachCommand) {
  for (auto fault = PlayerFault::kNone; fault <= test::kLastPlayerFault;
       fault = static_cast<PlayerFault>(static_cast<int>(fault) + 1)) {
    for (std::uint64_t from = 6; from < 30; ++from) {
      SCOPED_TRACE(testing::Message() << "fault " << int{static_cast<std::uint8_t>(fault)}
                                      << " from command " << from);
      ScriptedPlayer player(fault, from);
      Session session(player, kPeriod);
      // The driver, too, gives a player longer to start than to answer.
      while (session.state().report_count == 0)
        ASSERT_TRUE(session.step(std::nullopt, kPatience));
      const PlayerRequest request{.rate = 0.5F, .seek_s = 3};
      const MonotonicTime begin = player.now();
      const bool lives = run(session, player, request, std::chrono::seconds{3});
      const bool is_mortal = fault == PlayerFault::kDies || fault == PlayerFault::kHangs ||
                             fault == PlayerFault::kGarbage || fault == PlayerFault::kWrongTypes ||
                             fault == PlayerFault::kWrongIds || fault == PlayerFault::kFull;
      EXPECT_EQ(lives, !is_mortal);
      EXPECT_LE(player.now() - begin,
                is_mortal ? Session::kGoneAfter + milliseconds{300} : std::chrono::seconds{4});
      const PlayerState& state = session.state();
      EXPECT_TRUE(state.position_s >= 0 && state.position_s <= ScriptedPlayer::kDurationSeconds);
      const bool is_noisy = fault == PlayerFault::kGarbage || fault == PlayerFault::kWrongTypes ||
                            fault == PlayerFault::kLongLine;
      EXPECT_EQ(session.corrupt_count() > 0, is_noisy);
    }
  }
}

TEST(MpvSession, IsLateWhileAnswersAre) {
  ScriptedPlayer player(PlayerFault::kLate, 12);
  Session session(player, kPeriod);
  bool was_late = false;
  for (int i = 0; i < 200; ++i) {
    ASSERT_TRUE(session.step(PlayerRequest{}, kPatience));
    was_late = was_late || session.is_late();
  }
  EXPECT_TRUE(was_late);
  player.set_fault(PlayerFault::kNone);
  ASSERT_TRUE(run(session, player, {}, std::chrono::milliseconds{700}));
  EXPECT_FALSE(session.is_late());
}

}  // namespace
}  // namespace rtpm::device_mpv
