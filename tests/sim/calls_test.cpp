#include <gtest/gtest.h>

#include <cstdlib>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "attacker.hpp"
#include "history.hpp"
#include "network.hpp"
#include "scheduler.hpp"
#include "sealing.hpp"
#include "sim_client.hpp"
#include "sim_server.hpp"

// Whole conversations of the protocol on a simulated network and clock: the shipped code, no
// socket. One seed makes one history; a failing seed reports how to replay it.
namespace rtpm::sim {
namespace {

using namespace std::chrono_literals;
using wire::DropReason;

constexpr NetworkProfile kQuietNetwork{.delay_min = 20us, .delay_max = 40us};

/// The events that all seeds together covered; the test checks it, so that a simulation in which
/// nothing happens does not pass.
struct Coverage {
  wire::FrameCounters frames{};
  std::uint64_t done_count = 0;
  std::uint64_t not_run_count = 0;
  std::uint64_t may_have_run_count = 0;
  std::uint64_t lost_count = 0;
  std::uint64_t large_reply_count = 0;
  std::uint64_t received_count = 0;
  std::uint64_t sent_count = 0;
  std::uint64_t stream_count = 0;
  std::uint64_t item_count = 0;
  std::uint64_t large_item_count = 0;
  std::uint64_t cancelled_count = 0;
  std::uint64_t sealed_count = 0;
  std::uint64_t later_key_count = 0;
  std::uint64_t forged_count = 0;
  std::uint64_t renewal_count = 0;
  std::uint64_t held_count = 0;
  std::uint64_t stripped_count = 0;
  std::uint64_t revoked_count = 0;
};

/// The disaster in the middle of a conversation: a side dies and restarts, or a client loses its
/// grant for a moment.
enum class Disaster { kServer, kClient, kGrant };

/// Whether sessions are sealed, and attacked.
enum class Wire { kOpen, kSealed, kAttacked };

/// One server, some clients and a network, all from a seed.
class Conversation {
 public:
  Conversation(std::uint64_t seed, bool is_told, bool has_checksum = true, Wire wire = Wire::kOpen,
               int call_count = 50)
      : random_(seed), has_checksum_(has_checksum), call_count_(call_count), history_(is_told) {
    if (wire != Wire::kOpen) sealing_.emplace(random_, history_);
    if (wire == Wire::kAttacked) {
      attacker_.emplace(scheduler_, random_, network_);
      network_.set_tap([this](std::uint32_t from, std::uint32_t to, ConstBytes frame) {
        return attacker_->on_datagram(from, to, frame);
      });
    }
    const bool is_lane = random_.chance(700);
    server_.emplace(scheduler_, random_, network_, history_, server_profile(is_lane));
    const auto client_count = static_cast<std::uint32_t>(random_.between(1, 5));
    for (std::uint32_t number = 1; number <= client_count; ++number) {
      clients_.push_back(std::make_unique<SimClient>(scheduler_, random_, network_, history_,
                                                     client_profile(number)));
    }
  }

  void play() {
    network_.set_profile(network_profile());
    server_->start();
    for (const auto& client : clients_)
      client->start();
    plan_disasters();
    plan_garbage();
    if (attacker_) plan_revocations();
    const MonotonicTime end = scheduler_.now() + 1h;
    while (!are_all_done() && scheduler_.step(end)) {
    }
    if (are_all_done()) {
      make_peace();
    } else {
      is_hanging_ = true;
    }
    history_.finish();
  }

  /// Plays on a quiet network; returns whether this many datagrams were sent.
  bool play_with(Disaster disaster, int step) {
    int count = 0;
    network_.set_tap([this, disaster, step, &count](std::uint32_t, std::uint32_t, ConstBytes) {
      if (++count == step) scheduler_.after(Duration{0}, [this, disaster] { strike(disaster); });
      return true;
    });
    server_->start();
    for (const auto& client : clients_)
      client->start();
    const MonotonicTime end = scheduler_.now() + 1h;
    while (!are_all_done() && scheduler_.step(end)) {
    }
    make_peace();
    history_.finish();
    return count >= step;
  }

  [[nodiscard]] const History& history() const { return history_; }
  /// The number of clients whose call failed after the disasters.
  [[nodiscard]] int stuck_count() const { return stuck_count_; }
  /// Whether some call never ended.
  [[nodiscard]] bool is_hanging() const { return is_hanging_; }
  /// The resources that the server still held when all was quiet.
  [[nodiscard]] std::uint32_t leaked_count() const { return leaked_count_; }
  void add_to(Coverage& coverage) const {
    coverage.frames.add(server_->counters());
    if (sealing_) coverage.sealed_count += sealing_->sealed_count();
    if (sealing_) coverage.later_key_count += sealing_->later_key_count();
    if (attacker_) {
      coverage.forged_count += attacker_->forged_count();
      coverage.held_count += attacker_->held_count();
      coverage.stripped_count += attacker_->stripped_count();
    }
    coverage.revoked_count += revoked_count_;
    coverage.done_count += history_.count(Outcome::kDone);
    coverage.not_run_count += history_.count(Outcome::kNotRun);
    coverage.may_have_run_count += history_.count(Outcome::kMayHaveRun);
    coverage.received_count += history_.count(Outcome::kReceived);
    coverage.sent_count += history_.count(Outcome::kSent);
    for (const auto& client : clients_) {
      coverage.lost_count += client->lost_count();
      coverage.large_reply_count += client->large_reply_count();
      coverage.stream_count += client->stream_count();
      coverage.item_count += client->item_count();
      coverage.large_item_count += client->large_item_count();
      coverage.cancelled_count += client->cancelled_count();
      coverage.renewal_count += client->renewal_count();
    }
  }

 private:
  ServerProfile server_profile(bool is_lane) {
    ServerProfile profile;
    profile.sealing = sealing_ ? &*sealing_ : nullptr;
    profile.clock_offset = [this](std::uint32_t port) {
      return clients_[port - 10'001]->clock_offset();
    };
    profile.session_count_max = static_cast<std::uint32_t>(random_.between(1, 6));
    profile.is_lane = is_lane;
    // Calls take so long in a deferring server that a client leaves a whole window of them behind.
    profile.large_count = random_.chance(900) ? random_.between(std::size_t{2}, std::size_t{6}) : 0;
    profile.stream_count = random_.between(std::size_t{0}, std::size_t{6});
    profile.large_item_per_mille = random_.chance(500) ? 100 : 10;
    profile.service_max = random_.chance(300) ? 100ms : random_.chance(500) ? 5ms : 50us;
    return profile;
  }

  ClientProfile client_profile(std::uint32_t number) {
    ClientProfile profile;
    profile.sealing = sealing_ ? &*sealing_ : nullptr;
    profile.number = number;
    profile.call_count = call_count_;
    if (random_.chance(500)) {
      profile.clock_domain = kServerClock;
    } else {
      profile.clock_domain = random_.between(std::uint64_t{0}, std::uint64_t{1});
      profile.clock_offset = random_.between(Duration{-900s}, Duration{100'000s});
    }
    profile.deadline_min = 500us;
    profile.deadline_max = random_.chance(500) ? Duration{20ms} : Duration{3s};
    profile.pause_max = random_.chance(500) ? Duration{1ms} : Duration{2s};
    profile.open_call_max =
        random_.chance(500) ? std::uint16_t{1} : static_cast<std::uint16_t>(random_.between(2, 8));
    profile.close_per_mille = random_.chance(300) ? 200 : 0;
    profile.oneway_per_mille = random_.chance(500) ? 200 : 0;
    profile.stream_per_mille = random_.chance(500) ? 200 : 0;
    profile.cancel_per_mille = random_.chance(500) ? 100 : 0;
    profile.slow_taker_per_mille = random_.chance(300) ? 300 : 0;
    profile.large_per_mille = random_.chance(500) ? 300 : 0;
    profile.abandoned_per_mille = random_.chance(200) ? 200 : 0;
    return profile;
  }

  NetworkProfile network_profile() {
    NetworkProfile profile = kQuietNetwork;
    if (random_.chance(100)) return profile;
    profile.lost_per_mille = random_.between(0, 300);
    profile.doubled_per_mille = random_.between(0, 300);
    profile.late_per_mille = random_.between(0, 100);
    profile.delay_max = random_.between(profile.delay_min, Duration{5ms});
    profile.late_max = random_.chance(300) ? Duration{60s} : Duration{50ms};
    profile.corrupted_per_mille = !has_checksum_ || random_.chance(300) ? 50 : 0;
    profile.has_checksum = has_checksum_;
    profile.burst_per_mille = random_.chance(300) ? 5 : 0;
    profile.burst_max = 100ms;
    return profile;
  }

  void plan_disasters() {
    MonotonicTime when = scheduler_.now();
    for (auto count = random_.between(0, 3); count > 0; --count) {
      when += random_.between(Duration{1ms}, Duration{20s});
      if (random_.chance(300)) {
        scheduler_.at(when, [this] { server_->stop(); });
      } else {
        scheduler_.at(when, [this] { server_->kill(); });
      }
      when += random_.between(Duration{1us}, random_.chance(500) ? Duration{10ms} : Duration{2s});
      scheduler_.at(when, [this] { server_->start(); });
    }
    for (auto count = random_.between(0, 3); count > 0; --count) {
      scheduler_.after(random_.between(Duration{1ms}, Duration{20s}), [this] {
        clients_[random_.between(std::size_t{0}, clients_.size() - 1)]->restart();
      });
    }
    for (auto count = random_.between(0, 2); count > 0; --count) {
      when += random_.between(Duration{1ms}, Duration{20s});
      scheduler_.at(when, [this] { network_.set_partitioned(true); });
      when += random_.between(Duration{1ms}, Duration{5s});
      scheduler_.at(when, [this] { network_.set_partitioned(false); });
    }
  }

  void strike(Disaster disaster) {
    switch (disaster) {
      case Disaster::kServer:
        server_->kill();
        return server_->start();
      case Disaster::kClient:
        return clients_.front()->restart();
      case Disaster::kGrant:
        sealing_->set_revoked(1, true);
        server_->on_revoked();
        return sealing_->set_revoked(1, false);
    }
  }

  /// A client loses its grant at any time, and gets it back a while later.
  void plan_revocations() {
    for (auto count = random_.between(0, 3); count > 0; --count) {
      const MonotonicTime when = scheduler_.now() + random_.between(Duration{1ms}, Duration{20s});
      const auto client = static_cast<std::uint32_t>(random_.between(1, clients_.size()));
      scheduler_.at(when, [this, client] {
        ++revoked_count_;
        sealing_->set_revoked(client, true);
        server_->on_revoked();
      });
      scheduler_.at(
          when + random_.between(Duration{1us}, Duration{random_.chance(500) ? 50ms : 5s}),
          [this, client] { sealing_->set_revoked(client, false); });
    }
  }

  /// Other senders send noise to all sides.
  void plan_garbage() {
    for (int i = 0; i < 50; ++i) {
      scheduler_.after(random_.between(Duration{0}, Duration{20s}), [this] {
        Bytes noise(random_.between(0, 200));
        for (std::byte& byte : noise)
          byte = static_cast<std::byte>(random_.between(0, 255));
        const auto client = static_cast<std::uint32_t>(random_.between(1, clients_.size()));
        network_.send(9, random_.chance(500) ? kServerPort : 10'000 + client, noise);
      });
    }
  }

  [[nodiscard]] bool are_all_done() const {
    return std::ranges::all_of(clients_, [](const auto& client) { return client->is_done(); });
  }

  /// After all disasters, when the late copies have arrived, every client gets through.
  void make_peace() {
    network_.set_profile(kQuietNetwork);
    network_.set_partitioned(false);
    network_.set_tap(nullptr);
    run_for(150s);
    for (const auto& client : clients_) {
      // The first call may only find that the server is another one.
      for (int attempt = 0; attempt < 2; ++attempt) {
        client->call_once_more(10s);
        run_for(20s);
        if (client->last_outcome() == Outcome::kDone) break;
      }
      if (client->last_outcome() != Outcome::kDone) ++stuck_count_;
      // Waits so long that the next client's session may replace this client's session.
      run_for(wire::kSessionIdleMin + 1s);
    }
    leaked_count_ = server_->held_count();
  }

  void run_for(Duration duration) {
    const MonotonicTime end = scheduler_.now() + duration;
    while (scheduler_.step(end)) {
    }
  }

  Random random_;
  bool has_checksum_;
  int call_count_;
  Scheduler scheduler_;
  History history_;
  Network network_{scheduler_, random_, kQuietNetwork};
  std::optional<Sealing> sealing_;
  std::optional<Attacker> attacker_;
  std::optional<SimServer> server_;
  std::vector<std::unique_ptr<SimClient>> clients_;
  std::uint64_t revoked_count_ = 0;
  int stuck_count_ = 0;
  bool is_hanging_ = false;
  std::uint32_t leaked_count_ = 0;
};

/// Plays a sealed conversation in which the disaster strikes just when the datagram `step` is sent;
/// false if there is no such datagram.
bool survives(std::uint64_t seed, Disaster disaster, int step) {
  Conversation conversation(seed, /*is_told=*/false, /*has_checksum=*/true, Wire::kSealed,
                            /*call_count=*/8);
  const bool is_reached = conversation.play_with(disaster, step);
  const std::vector<std::string>& faults = conversation.history().faults();
  EXPECT_TRUE(faults.empty()) << faults.front() << ", step " << step << ", disaster "
                              << static_cast<int>(disaster);
  EXPECT_EQ(conversation.stuck_count(), 0) << step << ' ' << static_cast<int>(disaster);
  EXPECT_EQ(conversation.leaked_count(), 0u) << step << ' ' << static_cast<int>(disaster);
  return is_reached;
}

/// Plays the seed and fails the test if a promise was broken; returns the history's hash.
std::uint64_t play(std::uint64_t seed, bool is_told, Coverage& coverage, Wire wire = Wire::kOpen) {
  // An attacker's changed datagrams have the right checksum.
  Conversation conversation(seed, is_told, wire != Wire::kAttacked, wire);
  conversation.play();
  conversation.add_to(coverage);
  const std::vector<std::string>& faults = conversation.history().faults();
  if (!faults.empty() || conversation.stuck_count() > 0 || conversation.leaked_count() > 0) {
    ADD_FAILURE() << "seed " << seed << ": "
                  << (!faults.empty() ? faults.front()
                      : conversation.stuck_count() > 0
                          ? "a client is stuck"
                          : "the server holds calls without a waiting client")
                  << "; see it with\n  "
                  << (wire == Wire::kOpen ? "./dev sim --seed " : "./dev sim --sealed-seed ")
                  << seed;
  }
  return conversation.history().hash();
}

std::optional<std::uint64_t> number_from_environment(const char* name) {
  const char* const text = std::getenv(name);
  if (text == nullptr) return std::nullopt;
  return std::strtoull(text, nullptr, 10);
}

void expect_that_much_happened(const Coverage& coverage) {
  EXPECT_GT(coverage.done_count, 1000u);
  EXPECT_GT(coverage.not_run_count, 100u);
  EXPECT_GT(coverage.may_have_run_count, 100u);
  EXPECT_GT(coverage.received_count, 100u);
  EXPECT_GT(coverage.sent_count, 100u);
  EXPECT_GT(coverage.stream_count, 100u);
  EXPECT_GT(coverage.item_count, 10'000u);
  EXPECT_GT(coverage.large_item_count, 1000u);
  EXPECT_GT(coverage.cancelled_count, 100u);
  EXPECT_GT(coverage.lost_count, 10u);
  EXPECT_GT(coverage.large_reply_count, 100u);
  EXPECT_GT(coverage.frames.duplicate_answered_count, 100u);
  EXPECT_GT(coverage.frames.expired_count, 100u);
  EXPECT_GT(coverage.frames.refused_count, 100u);
  EXPECT_GT(coverage.frames.session_evicted_count, 10u);
  EXPECT_GT(coverage.frames.large_evicted_count, 10u);
  EXPECT_GT(coverage.frames.orphaned_count, 10u);
  EXPECT_GT(coverage.frames.item_repeated_count, 100u);
  for (const DropReason reason :
       {DropReason::kTooShort, DropReason::kBadMagic, DropReason::kUnknownSession,
        DropReason::kStaleCall, DropReason::kDuplicateRunning}) {
    EXPECT_GT(coverage.frames.dropped_for(reason), 10u) << to_string(reason);
  }
}

/// The seeds are played in portions, so that several cores can share them. RTPM_SEEDS sets their
/// total number; RTPM_SEED plays one alone and prints its history.
class Calls : public testing::TestWithParam<std::uint64_t> {
 protected:
  static constexpr std::uint64_t kPortionCount = 2;
  static constexpr std::uint64_t kSeedCount = 2000;
};

TEST_P(Calls, KeepTheirPromisesOverAnyNetwork) {
  Coverage coverage;
  if (const auto seed = number_from_environment("RTPM_SEED")) {
    if (*seed % kPortionCount == GetParam()) play(*seed, /*is_told=*/true, coverage);
    return;
  }
  const std::uint64_t seed_count = number_from_environment("RTPM_SEEDS").value_or(kSeedCount);
  std::uint64_t played_count = 0;
  for (std::uint64_t seed = GetParam(); seed < seed_count && !HasFailure(); seed += kPortionCount) {
    play(seed, /*is_told=*/false, coverage);
    ++played_count;
  }
  if (!HasFailure() && played_count >= 1000) expect_that_much_happened(coverage);
}

INSTANTIATE_TEST_SUITE_P(Portions, Calls, testing::Range(std::uint64_t{0}, std::uint64_t{2}));

/// In a quarter of the sealed conversations the network is the only enemy.
Wire wire_of(std::uint64_t seed) {
  return seed % 8 < 2 ? Wire::kSealed : Wire::kAttacked;
}

/// The sealed conversations: no datagram that is dropped, held back, repeated, changed or
/// forged on the path makes a call run twice, or a caller get a false outcome. RTPM_SEALED_SEEDS
/// sets the number of seeds.
class SealedCalls : public testing::TestWithParam<std::uint64_t> {
 protected:
  static constexpr std::uint64_t kPortionCount = 2;
  static constexpr std::uint64_t kSeedCount = 200;
};

// sec-5-1, sec-5-2, sec-6-1, sec-6-2, sec-6-3
TEST_P(SealedCalls, KeepTheirPromisesUnderAttack) {
  Coverage coverage;
  if (const auto seed = number_from_environment("RTPM_SEALED_SEED")) {
    if (*seed % kPortionCount == GetParam()) play(*seed, true, coverage, wire_of(*seed));
    return;
  }
  const std::uint64_t seed_count =
      number_from_environment("RTPM_SEALED_SEEDS").value_or(kSeedCount);
  for (std::uint64_t seed = GetParam(); seed < seed_count && !HasFailure(); seed += kPortionCount) {
    play(seed, /*is_told=*/false, coverage, wire_of(seed));
  }
  if (HasFailure()) return;
  EXPECT_GT(coverage.done_count, 1000u);
  EXPECT_GT(coverage.lost_count, 10u);
  EXPECT_GT(coverage.item_count, 1000u);
  EXPECT_GT(coverage.large_reply_count, 100u);
  EXPECT_GT(coverage.sealed_count, 10'000u);
  EXPECT_GT(coverage.later_key_count, 1000u);
  EXPECT_GT(coverage.forged_count, 1000u);
  EXPECT_GT(coverage.renewal_count, 100u);
  EXPECT_GT(coverage.held_count, 1000u);
  EXPECT_GT(coverage.stripped_count, 100u);
  EXPECT_GT(coverage.revoked_count, 50u);
  for (const DropReason reason : {DropReason::kUnsealed, DropReason::kBadSeal,
                                  DropReason::kReplayed, DropReason::kBadCookie}) {
    EXPECT_GT(coverage.frames.dropped_for(reason), 100u) << to_string(reason);
  }
}

INSTANTIATE_TEST_SUITE_P(Portions, SealedCalls, testing::Range(std::uint64_t{0}, std::uint64_t{2}));

// sec-6-3, sec-6-6: whenever a side dies or a grant goes, nothing runs twice and all goes on.
TEST(SealedSteps, AreAllSurvived) {
  for (const Disaster disaster : {Disaster::kServer, Disaster::kClient, Disaster::kGrant}) {
    for (const std::uint64_t seed : {std::uint64_t{1}, std::uint64_t{2}}) {
      for (int step = 1; step <= 40; ++step)
        EXPECT_TRUE(survives(seed, disaster, step));
    }
  }
}

TEST(Seeds, GiveTheSameHistoryEachTime) {
  Coverage coverage;
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    EXPECT_EQ(play(seed, false, coverage), play(seed, false, coverage));
  }
}

// Without the datagrams' checksum the promises of a call can't be kept. But nothing breaks, hangs
// or stays behind.
TEST(Corruption, LeavesNoHangAndNoState) {
  const std::uint64_t seed_count = number_from_environment("RTPM_SEEDS").value_or(2000) / 5;
  for (std::uint64_t seed = 0; seed < seed_count && !testing::Test::HasFailure(); ++seed) {
    Conversation conversation(seed, /*is_told=*/false, /*has_checksum=*/false);
    conversation.play();
    EXPECT_FALSE(conversation.is_hanging()) << "seed " << seed;
    EXPECT_EQ(conversation.leaked_count(), 0u) << "seed " << seed;
  }
}

// The checker itself: it detects a history that breaks a promise.
TEST(History, FindsEveryBrokenPromise) {
  const auto fault_of = [](auto tell) {
    History history(/*is_told=*/false);
    tell(history);
    history.finish();
    return history.faults().empty() ? std::string() : history.faults().front();
  };
  const MonotonicTime now = time_from_ns(0);
  const auto begin = [&](History& h, bool is_idempotent = false) {
    return h.begin(now, 1, is_idempotent, now + 1s);
  };
  EXPECT_EQ(fault_of([&](History& h) {
              const auto token = begin(h);
              h.reply(now, token, token, h.run(now, token));
              h.end(now, token, Outcome::kDone, "");
            }),
            "");
  EXPECT_EQ(fault_of([&](History& h) {
              const auto token = begin(h, true);
              h.run(now, token);
              h.run(now, token);
              h.end(now, token, Outcome::kDone, "");
            }),
            "");
  EXPECT_EQ(fault_of([&](History& h) {
              const auto token = begin(h);
              h.run(now, token);
              h.run(now, token);
            }),
            "call 1 of client 1 ran twice");
  EXPECT_EQ(fault_of([&](History& h) { h.run(now + 2s, begin(h)); }),
            "call 1 of client 1 was begun after its deadline");
  EXPECT_EQ(fault_of([&](History& h) {
              const auto token = begin(h);
              h.reply(now, token, token + 1, h.run(now, token));
            }),
            "call 1 of client 1 got the reply of call 2 of client 1");
  EXPECT_EQ(fault_of([&](History& h) {
              const auto token = begin(h);
              h.end(now, token, Outcome::kNotRun, "");
              h.run(now, token);
            }),
            "call 1 of client 1 ran, though its caller was told that it did not");
  EXPECT_EQ(fault_of([&](History& h) { h.end(now, begin(h), Outcome::kDone, ""); }),
            "call 1 of client 1 did not run, though its caller was told that it did");
  EXPECT_EQ(fault_of([&](History& h) { begin(h); }), "call 1 of client 1 never ended");
}

}  // namespace
}  // namespace rtpm::sim
