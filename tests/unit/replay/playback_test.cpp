#include "rtpm/replay/playback.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <mutex>
#include <vector>

#include "rtpm/test/os.hpp"

// A playback of ten messages, 1 ms apart.
namespace rtpm::replay {
namespace {

using rtpm::test::await;
using std::chrono::milliseconds;

class PlaybackTest : public testing::Test, public Script {
 protected:
  void TearDown() override { playback_->stop(); }
  void start(const Pace::Config& config) {
    playback_.emplace(*this, config);
    ASSERT_TRUE(playback_->start());
  }
  expected<void, SetupError> play(Duration from, const Turn& turn) override {
    for (int i = 0; i < 10; ++i) {
      if (milliseconds{i} < from) continue;
      if (!turn.reach(milliseconds{i})) return {};
      if (i == damage_) return setup_error("message 5", "it is broken");
      {
        const std::lock_guard lock(mutex_);
        played_.push_back(i);
      }
      static_cast<void>(await([this] { return !is_held_.load(); }));
    }
    return {};
  }
  expected<void, SetupError> show(Duration at, const Turn&) override {
    const std::lock_guard lock(mutex_);
    shown_.push_back(at);
    return {};
  }
  [[nodiscard]] std::vector<int> played() {
    const std::lock_guard lock(mutex_);
    return played_;
  }
  bool ends() {
    return await([this] { return !playback_->status().is_playing; });
  }

  std::mutex mutex_{};
  std::vector<int> played_{};
  std::vector<Duration> shown_{};
  int damage_ = -1;
  std::atomic<bool> is_held_ = false;  ///< Playing a message takes until this is false.
  std::optional<Playback> playback_{};
};

TEST_F(PlaybackTest, PlaysToTheEndAndThenFromTheBeginning) {
  start({.length = milliseconds{9}});
  EXPECT_FALSE(playback_->status().is_playing);
  for (int round = 0; round < 2; ++round) {
    playback_->play(10);
    ASSERT_TRUE(ends());
    EXPECT_EQ(played_, (std::vector<int>{0, 1, 2, 3, 4, 5, 6, 7, 8, 9}));
    EXPECT_EQ(playback_->status().position.at, milliseconds{9});
    played_.clear();
  }
}

TEST_F(PlaybackTest, PlaysLateMessagesAfterAPause) {
  is_held_ = true;
  start({.length = milliseconds{9}});
  playback_->play(1);
  EXPECT_TRUE(await([this] { return played().size() == 1; }));
  EXPECT_TRUE(await([this] { return playback_->status().position.at >= milliseconds{5}; }));
  playback_->pause();
  is_held_ = false;
  playback_->play(10);
  ASSERT_TRUE(ends());
  EXPECT_EQ(played_, (std::vector<int>{0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9})) << "the last one again";
}

TEST_F(PlaybackTest, SeeksAndContinuesFromThere) {
  start({.length = milliseconds{9}});
  playback_->seek(milliseconds{7});
  EXPECT_TRUE(await([this] {
    const std::lock_guard lock(mutex_);
    return shown_ == std::vector<Duration>{milliseconds{7}};
  }));
  EXPECT_EQ(playback_->status().position.at, milliseconds{7});
  playback_->play(1);
  ASSERT_TRUE(ends());
  EXPECT_EQ(played_, (std::vector<int>{7, 8, 9}));
}

TEST_F(PlaybackTest, StopsAtDamageAndSaysWhy) {
  damage_ = 5;
  start({.length = milliseconds{9}});
  playback_->play(1);
  ASSERT_TRUE(ends());
  EXPECT_EQ(playback_->status().problem, "message 5: it is broken");
  EXPECT_EQ(played_.size(), 5u);
}

TEST_F(PlaybackTest, BeginsAgainInALoopUntilItIsPaused) {
  start({.length = milliseconds{9}, .loops = true});
  playback_->play(1);
  EXPECT_TRUE(await([this] { return played().size() > 20; }));
  EXPECT_GE(playback_->status().position.round, 2u);
  playback_->pause();
  EXPECT_FALSE(playback_->status().is_playing);
}

TEST_F(PlaybackTest, FollowsSteps) {
  start({.length = milliseconds{9}, .stepped_count = 1});
  playback_->play(1);
  playback_->pace().step_to({milliseconds{3}});
  EXPECT_TRUE(await([this] { return played() == std::vector<int>{0, 1, 2, 3}; }));
}

}  // namespace
}  // namespace rtpm::replay
