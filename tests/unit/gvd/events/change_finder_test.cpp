#include "events/change_finder.hpp"

#include <gtest/gtest.h>

namespace rtpm::gvd {
namespace {

using driver::Fault;
using driver::Faults;
using driver::Lifecycle;

CycleRecord active_record() {
  CycleRecord record;
  record.sample.lifecycle = Lifecycle::kActive;
  return record;
}

std::vector<CycleChange> step(ChangeFinder& finder, const CycleRecord& record) {
  const auto changes = finder.step(record);
  return {changes.begin(), changes.end()};
}

class Changes : public ::testing::Test {
 protected:
  Changes() { static_cast<void>(finder_.step(record_)); }

  ChangeFinder finder_{0.5};
  CycleRecord record_ = active_record();
};

TEST(ChangesOfTheFirstRecord, DifferFromAnIdleDevice) {
  ChangeFinder finder{0.5};
  CycleRecord record = active_record();
  record.sample.buttons = 1;
  record.sample.button_edges[0] = 7;
  EXPECT_EQ(
      step(finder, record),
      (std::vector<CycleChange>{LifecycleChange{Lifecycle::kUnconfigured, Lifecycle::kActive}}));
}

TEST_F(Changes, AreEmptyWithoutADifference) {
  EXPECT_TRUE(finder_.step(record_).empty());
}

TEST_F(Changes, ReportEachEdgeOfAButton) {
  record_.sample.buttons = 0b10;
  record_.sample.button_edges[1] = 1;
  EXPECT_EQ(step(finder_, record_), (std::vector<CycleChange>{ButtonChange{1, true}}));
  // The button is released and pressed again between two records.
  record_.sample.button_edges[1] = 3;
  EXPECT_EQ(step(finder_, record_),
            (std::vector<CycleChange>{ButtonChange{1, false}, ButtonChange{1, true}}));
}

TEST_F(Changes, SurviveTheWrapOfAButtonsCounter) {
  record_.sample.button_edges[0] = 65535;
  static_cast<void>(finder_.step(record_));
  record_.sample.button_edges[0] = 1;
  EXPECT_EQ(step(finder_, record_),
            (std::vector<CycleChange>{ButtonChange{0, true}, ButtonChange{0, false}}));
}

TEST_F(Changes, KeepTheLastEdgesOfAShakingButton) {
  record_.sample.buttons = 1;
  record_.sample.button_edges[0] = 1001;
  const auto changes = step(finder_, record_);
  ASSERT_EQ(changes.size(), 8u);
  EXPECT_EQ(changes.back(), CycleChange(ButtonChange{0, true}));
}

TEST_F(Changes, HaveAHysteresisForContact) {
  auto& force_newton = record_.sample.wrench_applied.force_newton;
  force_newton = {0, 0.4, 0};
  EXPECT_TRUE(finder_.step(record_).empty());
  force_newton = {0, 0.3, 0.4};
  EXPECT_EQ(step(finder_, record_), (std::vector<CycleChange>{ContactChange{true, 0.5}}));
  force_newton = {0, 0.25, 0};
  EXPECT_TRUE(finder_.step(record_).empty());
  force_newton = {0, 0.125, 0};
  EXPECT_EQ(step(finder_, record_), (std::vector<CycleChange>{ContactChange{false, 0.125}}));
}

TEST_F(Changes, NameFaultsThatBeganAndEnded) {
  record_.sample.faults.set(Fault::kCommandLost);
  static_cast<void>(finder_.step(record_));
  record_.sample.faults = {};
  record_.sample.faults.set(Fault::kSoftStart);
  Faults lost;
  lost.set(Fault::kCommandLost);
  EXPECT_EQ(step(finder_, record_),
            (std::vector<CycleChange>{FaultChange{record_.sample.faults, lost}}));
}

TEST_F(Changes, ReportAnEmergencyStopBesideItsFault) {
  record_.sample.faults.set(Fault::kEmergencyStop);
  EXPECT_EQ(step(finder_, record_),
            (std::vector<CycleChange>{StopChange{true}, FaultChange{record_.sample.faults, {}}}));
  const Faults stop = std::exchange(record_.sample.faults, Faults{});
  EXPECT_EQ(step(finder_, record_),
            (std::vector<CycleChange>{StopChange{false}, FaultChange{{}, stop}}));
}

TEST_F(Changes, SayWhyTheLeaseEnded) {
  record_.is_held = true;
  record_.lease_serial = 1;
  EXPECT_EQ(step(finder_, record_), (std::vector<CycleChange>{LeaseChange{LeaseState::kHeld}}));
  // Another client takes the lease at once.
  record_.lease_serial = 2;
  record_.last_end = LeaseState::kTakenOver;
  EXPECT_EQ(step(finder_, record_), (std::vector<CycleChange>{LeaseChange{LeaseState::kTakenOver},
                                                              LeaseChange{LeaseState::kHeld}}));
  record_.is_held = false;
  record_.lease_serial = 0;
  record_.last_end = LeaseState::kSilent;
  EXPECT_EQ(step(finder_, record_), (std::vector<CycleChange>{LeaseChange{LeaseState::kSilent}}));
}

}  // namespace
}  // namespace rtpm::gvd
