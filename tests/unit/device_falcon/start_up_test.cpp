#include "rtpm/device_falcon/start_up.hpp"

#include <gtest/gtest.h>

#include "faults.hpp"
#include "scripted_falcon.hpp"

/// The start of a unit, on the time line of a model of it.
namespace rtpm::device_falcon {
namespace {

using std::chrono::seconds;
using test::FalconFault;
using test::FalconModel;
using test::FalconModelConfig;
using test::FalconStep;
using test::FaultAtStep;
using test::ScriptedFalcon;

struct Unit {
  explicit Unit(const FalconModelConfig& config)
      : model(std::make_shared<FalconModel>(config)), transport(model) {}

  /// Starts the unit, and records the outcome and how long it took.
  bool start(std::span<const std::byte> firmware) {
    const MonotonicTime begin = model->now();
    const auto started = start_up(transport, firmware);
    took = model->now() - begin;
    if (!started) refusal = started.error().text();
    EXPECT_FALSE(model->has_force());
    return started.has_value();
  }

  std::shared_ptr<FalconModel> model;
  ScriptedFalcon transport;
  Duration took{};
  std::string refusal;
};

TEST(FalconStartUp, LoadsTheFirmwareOnlyWhereNoneRuns) {
  Unit without({.has_firmware = false});
  ASSERT_TRUE(without.start(FalconModel::firmware()));
  EXPECT_LT(without.took, seconds{5});
  EXPECT_TRUE(without.model->runs_firmware());
  EXPECT_EQ(without.model->event_count(FalconStep::kPrompt), 1u);
  Unit with({});
  ASSERT_TRUE(with.start(FalconModel::firmware()));
  EXPECT_EQ(with.model->event_count(FalconStep::kPrompt), 0u);
}

TEST(FalconStartUp, AsksForAFirmware) {
  Unit unit({.has_firmware = false});
  ASSERT_FALSE(unit.start({}));
  EXPECT_NE(unit.refusal.find("firmware=FILE"), std::string::npos) << unit.refusal;
  EXPECT_LT(unit.took, seconds{3});
}

TEST(FalconStartUp, GivesAWrongFirmwareUpAfterSomeAttempts) {
  std::vector<std::byte> wrong = FalconModel::firmware();
  wrong[4000] ^= std::byte{1};
  Unit unit({.has_firmware = false});
  ASSERT_FALSE(unit.start(wrong));
  EXPECT_NE(unit.refusal.find("another file"), std::string::npos) << unit.refusal;
  EXPECT_EQ(unit.model->event_count(FalconStep::kPrompt), std::uint64_t{kLoadAttemptMax});
  EXPECT_LT(unit.took, seconds{20});
}

TEST(FalconStartUp, RepeatsALoadWhoseEchoIsWrong) {
  Unit unit(
      {.has_firmware = false, .plan = {FalconFault::kWrongEcho, FalconStep::kFirmware, 50, 1}});
  ASSERT_TRUE(unit.start(FalconModel::firmware()));
  EXPECT_EQ(unit.model->event_count(FalconStep::kPrompt), 2u);
}

TEST(FalconStartUp, DoesNotTakeAnEchoForAFirmware) {
  // A half-loaded boot loader behaves like this: it returns the bytes it is sent unchanged.
  class Echo final : public Transport {
   public:
    UsbStatus request(FtdiRequest, std::uint16_t) override { return UsbStatus::kOk; }
    UsbStatus send(std::span<const std::byte> bytes) override {
      echo_.assign(2, std::byte{0});
      echo_.insert(echo_.end(), bytes.begin(), bytes.end());
      return UsbStatus::kOk;
    }
    Received receive(std::span<std::byte> buffer, Duration patience) override {
      now_ += patience;
      std::ranges::copy(echo_, buffer.begin());
      const std::size_t size = std::exchange(echo_, {}).size();
      return {size > 0 ? UsbStatus::kOk : UsbStatus::kTimeout, size, now_};
    }
    MonotonicTime now() const override { return now_; }

   private:
    std::vector<std::byte> echo_;
    MonotonicTime now_{};
  } echo;
  EXPECT_FALSE(start_up(echo, {}));
}

class FalconStartUpFaults : public testing::TestWithParam<FaultAtStep> {};

/// A fault from one event on, for one event or for all: the start ends in time, without force, and
/// says why if it fails. It overcomes a momentary fault; a fault that ends has no later effect.
TEST_P(FalconStartUpFaults, AreSurvived) {
  const std::vector<std::byte> firmware = FalconModel::firmware();
  for (const std::uint64_t from : {0u, 7u, 60u, 120u}) {
    for (const std::uint64_t count : {std::uint64_t{1}, std::uint64_t{3}, test::kForGood}) {
      SCOPED_TRACE(testing::Message() << "from " << from << " count " << count);
      Unit unit({.has_firmware = false, .plan = {GetParam().fault, GetParam().step, from, count}});
      const bool is_started = unit.start(firmware);
      EXPECT_LT(unit.took, seconds{20});
      if (!is_started) {
        EXPECT_GT(unit.refusal.size(), 40u);
      }
      const bool is_of_the_moment = count == 1 && GetParam().fault != FalconFault::kNoDevice;
      if (is_of_the_moment) {
        EXPECT_TRUE(is_started) << unit.refusal;
      }
      unit.model->set_plan({});
      unit.model->plug_in();
      EXPECT_TRUE(unit.start(firmware)) << unit.refusal;
      if (testing::Test::HasFailure()) return;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Steps, FalconStartUpFaults,
                         testing::ValuesIn(test::every_fault_at_every_step()),
                         [](const auto& test) { return test::name_of(test.param); });

}  // namespace
}  // namespace rtpm::device_falcon
