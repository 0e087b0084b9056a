#include <gtest/gtest.h>

#include <functional>
#include <thread>
#include <utility>

#include "rtpm/device_mpv/mpv_driver.hpp"
#include "scripted_player.hpp"

/// The driver with its thread, and a model of mpv whose time only that thread advances.
namespace rtpm::device_mpv {
namespace {

using driver::Command;
using driver::CommandMode;
using driver::ExchangeStatus;
using test::PlayerFault;
using test::ScriptedPlayer;

class MpvDriverTest : public testing::Test {
 protected:
  /// Only the first player has the fault; the next one works.
  void start(PlayerFault fault, std::uint64_t faulty_from) {
    driver_ = std::make_unique<MpvDriver>(
        [fault, faulty_from]() mutable {
          return std::make_unique<ScriptedPlayer>(std::exchange(fault, PlayerFault::kNone),
                                                  faulty_from);
        },
        "scripted-1", "p");
    ASSERT_TRUE(driver_->configure({.period = std::chrono::milliseconds{10}}));
    ASSERT_TRUE(driver_->activate());
  }
  ExchangeStatus exchange(float rate, float seek_s) {
    Command command;
    command.mode = CommandMode::kOutputs;
    command.cycle_time = now_ += std::chrono::milliseconds{10};
    command.outputs = {rate, seek_s};
    return driver_->exchange(command, sample_);
  }
  /// Exchanges until `is_done`; the player's own time advances meanwhile.
  bool exchange_until(float rate, float seek_s,
                      const std::function<bool(ExchangeStatus)>& is_done) {
    for (int i = 0; i < 1'000'000; ++i) {
      if (is_done(exchange(rate, seek_s))) return true;
      std::this_thread::yield();
    }
    return false;
  }

  std::unique_ptr<MpvDriver> driver_;
  driver::Sample sample_{};
  MonotonicTime now_{std::chrono::seconds{1000}};
};

constexpr std::uint64_t kNever = ~std::uint64_t{0};

TEST_F(MpvDriverTest, HasTheFirstSampleAtOnce) {
  start(PlayerFault::kNone, kNever);
  ASSERT_EQ(exchange(0, -1), ExchangeStatus::kOk);
  EXPECT_EQ(sample_.analogs[2], 20);
  EXPECT_EQ(sample_.analogs[3], 1);
  EXPECT_FLOAT_EQ(sample_.analogs[4], 0.04F);
}

TEST_F(MpvDriverTest, PausesWithoutACommand) {
  start(PlayerFault::kNone, kNever);
  ASSERT_TRUE(exchange_until(1, -1, [&](auto) { return sample_.analogs[1] == 1; }));
  Command off;
  for (int i = 0; i < 1'000'000 && sample_.analogs[3] == 0; ++i) {
    off.cycle_time = now_ += std::chrono::milliseconds{10};
    ASSERT_EQ(driver_->exchange(off, sample_), ExchangeStatus::kOk);
    std::this_thread::yield();
  }
  EXPECT_EQ(sample_.analogs[3], 1);
}

TEST_F(MpvDriverTest, IsGoneWithThePlayerAndBackWithTheNext) {
  for (const auto fault : {PlayerFault::kDies, PlayerFault::kHangs, PlayerFault::kFull}) {
    start(fault, 100);
    ASSERT_TRUE(exchange_until(1, -1, [](auto status) { return status == ExchangeStatus::kGone; }));
    const driver::Sample before = sample_;
    EXPECT_EQ(exchange(1, -1), ExchangeStatus::kGone);
    EXPECT_EQ(sample_.analogs, before.analogs);
    driver_->deactivate();
    ASSERT_TRUE(driver_->configure({.period = std::chrono::milliseconds{10}}));
    ASSERT_TRUE(driver_->activate());
    EXPECT_EQ(exchange(1, -1), ExchangeStatus::kOk);
  }
}

TEST_F(MpvDriverTest, ReportsLateAndCorrupt) {
  start(PlayerFault::kLate, 60);
  EXPECT_TRUE(exchange_until(1, -1, [](auto status) { return status == ExchangeStatus::kLate; }));
  start(PlayerFault::kLongLine, 60);
  EXPECT_TRUE(
      exchange_until(1, -1, [](auto status) { return status == ExchangeStatus::kCorrupt; }));
}

TEST_F(MpvDriverTest, RefusesAPlayerThatDoesNotAnswer) {
  for (const auto fault : {PlayerFault::kDies, PlayerFault::kHangs, PlayerFault::kGarbage}) {
    MpvDriver driver([=] { return std::make_unique<ScriptedPlayer>(fault, 0); }, "s", "p");
    const auto configured = driver.configure({.period = std::chrono::milliseconds{10}});
    ASSERT_FALSE(configured);
    EXPECT_FALSE(configured.error().text().empty());
    EXPECT_FALSE(driver.activate());
  }
}

}  // namespace
}  // namespace rtpm::device_mpv
