#pragma once

#include <array>
#include <cstdint>

#include "history.hpp"
#include "network.hpp"
#include "rtpm/wire/client_channel.hpp"

namespace rtpm::sim {

/// How a simulated client works.
struct ClientProfile {
  std::uint32_t number = 1;
  std::uint64_t clock_domain = 0;  ///< The server's: both read one clock.
  Duration clock_offset{};         ///< Of another clock.
  int call_count = 50;
  Duration deadline_min{};
  Duration deadline_max{};
  Duration pause_max{};                     ///< Between two calls, usually;
  std::uint64_t long_pause_per_mille = 10;  ///< at times it is so long that sessions are replaced.
  std::uint64_t idempotent_per_mille = 200;
  std::uint64_t close_per_mille = 0;  ///< Sessions that it closes between two calls.
  std::uint64_t large_per_mille = 0;  ///< Requests and, apart from them, replies in fragments.
};

/// One ClientChannel behind a socket, and above it the rule of rpc::Binding for what to do when a
/// session is lost (hp-5.5-2), mirrored here because it is not the channel's.
class SimClient {
 public:
  SimClient(Scheduler& scheduler, Random& random, Network& network, History& history,
            const ClientProfile& profile);
  SimClient(const SimClient&) = delete;
  SimClient& operator=(const SimClient&) = delete;

  /// Begins its calls.
  void start();
  [[nodiscard]] bool is_done() const noexcept { return calls_left_ == 0; }
  /// One more call with plenty of time, when all is well again.
  void call_once_more(Duration deadline);
  [[nodiscard]] Outcome last_outcome() const noexcept { return last_outcome_; }
  /// Replies in fragments that came whole.
  [[nodiscard]] std::uint64_t large_reply_count() const noexcept { return large_reply_count_; }
  [[nodiscard]] std::uint64_t lost_count() const noexcept { return lost_count_; }

 private:
  static constexpr int kRoundCountMax = 4;  // As in rpc::Binding.

  [[nodiscard]] MonotonicTime local_now() const { return scheduler_.now() + profile_.clock_offset; }
  void pause();
  void begin_call(Duration deadline);
  void advance();
  void send(ConstBytes frame);
  [[nodiscard]] std::uint32_t message_size();
  void wait();
  void handle(const wire::ChannelEvent& event);
  void on_ready();
  void on_reply(const wire::ChannelEvent& event);
  void on_lost();
  void end(Outcome outcome, std::string_view why);

  Scheduler& scheduler_;
  Random& random_;
  Network& network_;
  History& history_;
  ClientProfile profile_;
  std::uint32_t port_;
  std::array<std::byte, wire::kDatagramFrameSizeMax> buffer_{};
  std::vector<std::byte> payload_;
  std::vector<std::byte> room_;
  wire::ClientChannel channel_;
  int calls_left_;
  std::uint64_t wait_number_ = 0;  ///< A wake-up of an earlier wait is none.
  History::Token token_ = 0;
  bool is_idempotent_ = false;
  bool may_have_run_ = false;  ///< In a former life of the server.
  bool is_resending_ = false;  ///< The session was lost; sends again if the server is the same.
  int round_ = 0;
  MonotonicTime deadline_{};
  MonotonicTime begun_{};
  std::uint64_t epoch_of_call_ = 0;
  Outcome last_outcome_ = Outcome::kOpen;
  std::uint64_t lost_count_ = 0;
  std::uint64_t large_reply_count_ = 0;
};

}  // namespace rtpm::sim
