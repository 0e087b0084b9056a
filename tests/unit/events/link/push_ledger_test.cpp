#include "supplier/push_ledger.hpp"

#include <gtest/gtest.h>

// A supplier's account of its events when connections and hubs end.
namespace rtpm::events {
namespace {

class Ledger : public testing::Test {
 protected:
  void send(std::uint64_t hub, int frame_count, std::uint32_t events_each = 1) {
    for (int i = 0; i < frame_count; ++i)
      ledger_.note_sent(hub, events_each);
  }
  void expect_counts(std::uint64_t sent, std::uint64_t unconfirmed,
                     std::uint64_t maybe_lost) const {
    EXPECT_EQ(ledger_.sent_count(), sent);
    EXPECT_EQ(ledger_.unconfirmed_count(), unconfirmed);
    EXPECT_EQ(ledger_.maybe_lost_count(), maybe_lost);
  }

  PushLedger ledger_;
};

TEST_F(Ledger, CountsEventsThatTheHubConfirmed) {
  send(1, 10);
  expect_counts(10, 10, 0);
  ledger_.note_counted(1, 7);
  expect_counts(10, 3, 0);
  ledger_.note_counted(1, 10);
  expect_counts(10, 0, 0);
}

TEST_F(Ledger, CountsFramesThatTheHubRead) {
  send(1, 100, 5);
  ledger_.note_end(3);
  expect_counts(500, 0, 15);
  send(2, 1, 5);
  expect_counts(505, 5, 15);
}

TEST_F(Ledger, TrustsTheBetterOfBothCounts) {
  send(1, 100);
  ledger_.note_counted(1, 90);
  ledger_.note_end(30);
  expect_counts(100, 0, 10);
}

TEST_F(Ledger, CountsUnconfirmedEventsAsMaybeLostAfterARestart) {
  send(1, 100);
  ledger_.note_counted(1, 40);
  send(2, 1);
  expect_counts(101, 1, 60);
  ledger_.note_counted(1, 100);
  expect_counts(101, 1, 60);
  ledger_.note_counted(2, 1);
  expect_counts(101, 0, 60);
}

TEST_F(Ledger, CorrectsLossesThatTheSameHubConfirmsLater) {
  send(1, 10);
  ledger_.note_end(10);
  expect_counts(10, 0, 10);
  send(1, 5);
  expect_counts(15, 5, 10);
  ledger_.note_counted(1, 5);
  expect_counts(15, 0, 10);
  ledger_.note_counted(1, 12);
  expect_counts(15, 0, 3);
  ledger_.note_counted(1, 15);
  expect_counts(15, 0, 0);
}

TEST_F(Ledger, AddsUpLossesOfConnectionsToTheSameHub) {
  send(1, 10);
  ledger_.note_end(2);
  send(1, 10);
  ledger_.note_end(3);
  expect_counts(20, 0, 5);
  send(2, 1);
  expect_counts(21, 1, 5);
}

TEST_F(Ledger, ContinuesAfterTheHubEvictedTheSupplier) {
  send(1, 20);
  ledger_.note_counted(1, 10);
  ledger_.note_counted(1, 4);
  expect_counts(20, 6, 0);
  ledger_.note_counted(1, 10);
  expect_counts(20, 0, 0);
}

TEST_F(Ledger, CountsEvictedFramesAsMaybeLost) {
  send(1, 10'000, 2);
  ledger_.note_end(5'000);
  expect_counts(20'000, 0, 20'000);
}

TEST_F(Ledger, CountsADoubtfulFrameAsMaybeLost) {
  send(1, 3, 4);
  ledger_.note_counted(1, 8);
  ledger_.note_doubtful();
  expect_counts(12, 0, 4);
  ledger_.note_failed(2);
  EXPECT_EQ(ledger_.failed_count(), 2U);
}

}  // namespace
}  // namespace rtpm::events
