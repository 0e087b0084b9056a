#pragma once

#include <array>
#include <cstdint>
#include <list>
#include <optional>

#include "history.hpp"
#include "network.hpp"
#include "rtpm/wire/client_channel.hpp"
#include "sealing.hpp"

namespace rtpm::sim {

/// How a simulated client works.
struct ClientProfile {
  std::uint32_t number = 1;
  std::uint64_t clock_domain = 0;  ///< By default the server's: both read one clock.
  Duration clock_offset{};         ///< Applies if it has another clock.
  int call_count = 50;
  std::uint16_t open_call_max = 1;  ///< Calls at a time.
  Duration deadline_min{};
  Duration deadline_max{};
  Duration pause_max{};                     ///< The usual pause between two calls;
  std::uint64_t long_pause_per_mille = 10;  ///< sometimes so long that sessions are replaced.
  std::uint64_t idempotent_per_mille = 200;
  std::uint64_t close_per_mille = 0;  ///< Sessions that it closes between two calls.
  std::uint64_t large_per_mille = 0;  ///< Requests, and separately replies, in fragments.
  /// Calls that are large and have plenty of time; it dies before they end.
  std::uint64_t abandoned_per_mille = 0;
  std::uint64_t oneway_per_mille = 0;      ///< Calls that are merely sent, or confirmed on receipt.
  std::uint64_t stream_per_mille = 0;      ///< Calls of streams.
  std::uint64_t cancel_per_mille = 0;      ///< Calls that it cancels at some time.
  std::uint64_t slow_taker_per_mille = 0;  ///< Streams whose items are left for a while.
  Sealing* sealing = nullptr;              ///< Null if its sessions are not sealed.
};

/// One ClientChannel behind a socket, and above it rpc::Binding's rule for a lost session
/// (hp-5.5-2), mirrored here because the channel does not implement it.
class SimClient {
 public:
  SimClient(Scheduler& scheduler, Random& random, Network& network, History& history,
            const ClientProfile& profile);
  SimClient(const SimClient&) = delete;
  SimClient& operator=(const SimClient&) = delete;

  /// Begins its calls.
  void start();
  [[nodiscard]] bool is_done() const noexcept { return calls_left_ == 0 && jobs_.empty(); }
  /// Dies with all its calls and restarts, under another epoch but at the same address.
  void restart();
  /// Makes one more call with plenty of time, when all is well again.
  void call_once_more(Duration deadline);
  [[nodiscard]] Outcome last_outcome() const noexcept { return last_outcome_; }
  /// The number of replies in fragments that came whole.
  [[nodiscard]] std::uint64_t large_reply_count() const noexcept { return large_reply_count_; }
  [[nodiscard]] std::uint64_t lost_count() const noexcept { return lost_count_; }
  /// The number of streams that ended in order, and of the items that came.
  [[nodiscard]] std::uint64_t stream_count() const noexcept { return stream_count_; }
  [[nodiscard]] std::uint64_t item_count() const noexcept { return item_count_; }
  [[nodiscard]] std::uint64_t large_item_count() const noexcept { return large_item_count_; }
  [[nodiscard]] std::uint64_t renewal_count() const noexcept { return renewal_count_; }
  /// How far its clock is ahead of the server's; nullopt if both know that they read one clock.
  [[nodiscard]] std::optional<Duration> clock_offset() const noexcept {
    if (profile_.clock_domain == kServerClock) return std::nullopt;
    return profile_.clock_offset;
  }
  [[nodiscard]] std::uint64_t cancelled_count() const noexcept { return cancelled_count_; }

 private:
  static constexpr int kRoundCountMax = 4;  // The limit of rpc::Binding.

  /// A call as its caller sees it, from start to end. It may span several sessions.
  struct Job {
    std::uint64_t number = 0;
    History::Token token = 0;
    wire::Delivery delivery = wire::Delivery::kReply;
    bool is_stream = false;
    bool is_idempotent = false;
    bool may_have_run = false;  ///< Before the server restarted.
    bool is_resending = false;  ///< The session was lost; sends again if the server is the same.
    bool is_waiting = true;     ///< Waits for a session or for a free slot in it.
    int round = 0;
    MonotonicTime deadline{};
    MonotonicTime begun{};
    std::uint64_t epoch = 0;
    wire::CallIndex index = 0;  ///< On the channel, unless it waits.
    std::vector<std::byte> payload;
    std::vector<std::byte> items;
    std::vector<std::byte> large_item;
    std::uint32_t item_count = 0;
    bool is_over = false;  ///< A stream that has ended; items may be left.
    wire::Status end_status = wire::Status::kOk;
  };
  using Jobs = std::list<Job>;

  void make_channel();
  [[nodiscard]] MonotonicTime local_now() const { return scheduler_.now() + profile_.clock_offset; }
  void pause();
  void begin_job(Duration deadline, bool is_plain);
  void begin_abandoned_job();
  void plan_cancel(std::uint64_t number);
  void pump();
  [[nodiscard]] bool may_begin(Job& job);
  void begin_call(Jobs::iterator job);
  void send(ConstBytes frame);
  [[nodiscard]] std::uint32_t message_size(std::uint64_t large_per_mille);
  void renew();
  void transmit(ConstBytes frame);
  void receive(const Bytes& frame);
  void take(ConstBytes frame);
  void follow(sealed::SealedClient::Step step);
  void wait();
  void on_time();
  void handle(const wire::ChannelEvent& event);
  [[nodiscard]] Jobs::iterator job_of(wire::CallIndex index);
  [[nodiscard]] Jobs::iterator job_number(std::uint64_t number);
  void on_reply(const wire::ChannelEvent& event);
  void take_items(Jobs::iterator job);
  void on_lost();
  void on_closed();
  void on_no_session(const wire::ChannelEvent& event);
  void end(Jobs::iterator job, Outcome outcome, std::string_view why);

  Scheduler& scheduler_;
  Random& random_;
  Network& network_;
  History& history_;
  ClientProfile profile_;
  std::uint32_t port_;
  std::array<std::byte, wire::kDatagramFrameSizeMax> buffer_{};
  std::array<std::vector<std::byte>, wire::kCallWindow> rooms_;
  std::uint64_t epoch_;
  std::optional<wire::ClientChannel> channel_;
  std::optional<sealed::SealedClient> sealed_;
  Jobs jobs_;
  std::uint64_t job_serial_ = 0;
  int calls_left_;
  bool is_opening_ = false;
  bool is_pausing_ = false;
  std::uint64_t wait_number_ = 0;  ///< A wake-up of an earlier wait does not count.
  Outcome last_outcome_ = Outcome::kOpen;
  std::uint64_t lost_count_ = 0;
  std::uint64_t large_reply_count_ = 0;
  std::uint64_t stream_count_ = 0;
  std::uint64_t item_count_ = 0;
  std::uint64_t large_item_count_ = 0;
  std::uint64_t cancelled_count_ = 0;
  std::uint64_t renewal_count_ = 0;
};

}  // namespace rtpm::sim
