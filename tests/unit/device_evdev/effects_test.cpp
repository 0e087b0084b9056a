#include "rtpm/device_evdev/effects.hpp"

#include <gtest/gtest.h>

#include "evdev_model.hpp"
#include "rtpm/device_evdev/layout.hpp"

/// The effects of a model, on its own time line.
namespace rtpm::device_evdev {
namespace {

using std::chrono::milliseconds;
using test::EvdevFault;
using test::EvdevModel;

class EvdevEffects : public testing::Test {
 protected:
  void start() { ASSERT_TRUE(bank_.start(0.5, true)); }
  EffectStatus update(const Levels& levels) { return bank_.update(levels, model_.now()); }

  EvdevModel model_{EvdevModel::wheel()};
  std::unique_ptr<Transport> transport_ = std::move(*model_.access().open({}, false));
  Layout layout_ = make_layout(EvdevModel::wheel(), {});
  EffectBank bank_{*transport_, layout_.effects};
};

TEST_F(EvdevEffects, AreUploadedOnceAndThenOnlyChanged) {
  start();
  EXPECT_EQ(model_.effect_count(), 3u);
  EXPECT_TRUE(model_.is_still());
  EXPECT_EQ(model_.gain(), 0.5);
  EXPECT_FALSE(model_.has_autocenter());
  for (std::int16_t level = 1; level <= 100; ++level) {
    ASSERT_EQ(update({.effort = level, .damper = 7}), EffectStatus::kOk);
    EXPECT_EQ(model_.levels(), (Levels{.effort = level, .damper = 7}));
    EXPECT_EQ(bank_.applied(), model_.levels());
  }
  EXPECT_EQ(model_.new_effect_count(), 3u);
  const std::uint64_t upload_count = model_.upload_count();
  ASSERT_EQ(update({.effort = 100, .damper = 7}), EffectStatus::kOk);
  EXPECT_EQ(model_.upload_count(), upload_count) << "the same levels need no upload";
}

TEST_F(EvdevEffects, PlayOnlyAsLongAsTheyAreUpdated) {
  start();
  for (int i = 0; i < 100; ++i) {
    ASSERT_EQ(update({.effort = -500}), EffectStatus::kOk);
    model_.advance(milliseconds{20});
    ASSERT_EQ(model_.levels().effort, -500) << "after " << i * 20 << " ms";
  }
  model_.advance(EffectBank::kLength);
  EXPECT_TRUE(model_.is_still()) << "the driver hangs";
}

TEST_F(EvdevEffects, EndAtOnceWithALevelOfZero) {
  start();
  ASSERT_EQ(update({.effort = 500, .spring = 9}), EffectStatus::kOk);
  ASSERT_EQ(update({}), EffectStatus::kOk);
  EXPECT_TRUE(model_.is_still());
  bank_.stop();
  EXPECT_EQ(model_.effect_count(), 0u);
}

TEST_F(EvdevEffects, AreStoppedWhenALevelIsRefused) {
  start();
  ASSERT_EQ(update({.effort = 500}), EffectStatus::kOk);
  model_.set_fault(EvdevFault::kUploadFails);
  EXPECT_EQ(update({.effort = -500}), EffectStatus::kRefused);
  EXPECT_TRUE(model_.is_still()) << "rather than the former force";
  EXPECT_EQ(bank_.applied(), Levels{});
  model_.set_fault(EvdevFault::kNone);
  EXPECT_EQ(update({.effort = -500}), EffectStatus::kOk);
  EXPECT_EQ(model_.levels().effort, -500);
}

TEST_F(EvdevEffects, AreGoneWithTheDeviceOrWhenAllIsRefused) {
  start();
  model_.set_fault(EvdevFault::kUploadFails);
  int refusal_count = 0;
  while (update({.effort = 1}) == EffectStatus::kRefused)
    ++refusal_count;
  EXPECT_EQ(refusal_count, EffectBank::kRefusalMax - 1);
  model_.set_fault(EvdevFault::kGone);
  EXPECT_EQ(update({.effort = 2}), EffectStatus::kGone);
}

TEST_F(EvdevEffects, NeedSlots) {
  for (std::uint64_t from = 2; from < 5; ++from) {
    model_.set_fault(EvdevFault::kNoSlots, from);
    const auto started = bank_.start(1, true);
    ASSERT_FALSE(started);
    EXPECT_NE(started.error().text().find("end the program"), std::string::npos);
    EXPECT_EQ(model_.effect_count(), 0u) << "those before it are erased";
  }
}

}  // namespace
}  // namespace rtpm::device_evdev
