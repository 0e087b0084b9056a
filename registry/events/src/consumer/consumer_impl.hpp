#pragma once

#include <atomic>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "broadcast/common_reader.hpp"
#include "consumer/assembler.hpp"
#include "consumer/multicast_session.hpp"
#include "consumer/ring_session.hpp"
#include "idl.hpp"
#include "rtpm/events/consumer.hpp"
#include "rtpm/rt/thread.hpp"

namespace rtpm::events {

inline constexpr std::string_view kQueueWasFull =
    "The subscription has ended, as its queue was full and its policy is to disconnect then.";

/// A consumer; its thread subscribes, delivers and resubscribes.
class Consumer::Impl final : private ReaderSeat::Member {
  friend class Consumer;

 public:
  Impl(rpc::Node& node, std::string target, ConsumerConfig config, EventHandler& handler);
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;
  ~Impl() override;

  [[nodiscard]] expected<void, SetupError> begin();
  [[nodiscard]] expected<void, SetupError> change(const Filter& filter,
                                                  const DeliveryPolicy& delivery);
  [[nodiscard]] expected<void, rpc::CallError> control(Action action);
  void unsubscribe();
  [[nodiscard]] bool is_subscribed() const noexcept { return subscription_id_ != 0; }

 private:
  /// A subscription that lasts until the hub restarts or the connection is lost.
  struct Session {
    std::shared_ptr<HubClient> client;  ///< Outlives the stream.
    rpc::TableStream<Batch> stream;
    const Batch* first = nullptr;                   ///< The item with the welcome, until processed.
    std::unique_ptr<BroadcastSession> broadcast{};  ///< Null if events arrive in the stream.
    std::shared_ptr<CommonReader> reader{};         ///< Null if its own thread reads.
  };
  /// Why open() failed.
  struct Failure : SetupError {
    bool is_final = false;  ///< The hub refused: do not retry.
  };
  using Opened = expected<std::unique_ptr<Session>, Failure>;

  void run();
  [[nodiscard]] bool resubscribe(Session& session);
  [[nodiscard]] Opened open();
  [[nodiscard]] SubscribeRequestT request() const;
  /// The reader to share. If null, the consumer uses its own thread.
  [[nodiscard]] std::shared_ptr<CommonReader> reader_of(std::uint64_t broadcast,
                                                        const std::string& interface,
                                                        const CommonReader::MakeSource& make) const;
  [[nodiscard]] std::unique_ptr<RingSession> open_ring(HubClient& client,
                                                       std::shared_ptr<CommonReader>& reader);
  [[nodiscard]] std::unique_ptr<MulticastSession> open_multicast(
      HubClient& client, std::shared_ptr<CommonReader>& reader);
  [[nodiscard]] std::string read(Session& session);
  /// Polls the stream until `until`; returns why it ended, if it did.
  [[nodiscard]] std::optional<std::string> poll_stream(Session& session, MonotonicTime until);
  void take(const Batch& batch);
  void update_losses();
  /// Reports this consumer's progress to the hub, each second.
  void note_progress(Session& session);
  void hand_over(std::span<const EventView> events);
  void notify(NoticeKind kind, std::string_view text, Duration gap = Duration{0},
              bool has_hub_restarted = false);
  void report_begin(std::optional<SetupError> error);
  [[nodiscard]] bool sleep_unless_stopping(Duration span);
  /// Reads the broadcast, in turns with a common reader. Returns why the stream ended.
  [[nodiscard]] std::string read_broadcast(Session& session);
  [[nodiscard]] std::optional<std::string> attend(Session& session);
  [[nodiscard]] std::optional<std::string> take_all(ReaderSeat& seat, MonotonicTime until);
  [[nodiscard]] Taking take_one() noexcept override;
  /// Wakes its own thread while a common reader serves it.
  void wake_own_thread();
  /// Whether the caller is inside the handler.
  [[nodiscard]] bool is_in_handler() const noexcept;

  rpc::Node& node_;
  const std::string target_;
  EventHandler& handler_;
  const BroadcastSession::Taker taker_;
  Assembler assembler_;

  mutable std::mutex mutex_;  ///< Guards the members below; never held while the handler runs.
  std::condition_variable changed_;
  ConsumerConfig config_;  ///< Only its filter and delivery change.
  std::shared_ptr<HubClient> control_client_{};
  bool has_begun_ = false;
  std::optional<SetupError> begin_error_{};
  ConsumerCounters counters_{};
  Losses earlier_losses_{};  ///< Losses of earlier sessions.

  Duration lag_{0};  ///< The greatest since the last note to the hub.

  MonotonicTime last_heard_{};
  MonotonicTime next_note_{};
  std::uint64_t last_epoch_ = 0;
  std::atomic<bool> is_suspended_{false};
  Losses hub_losses_{};  ///< Losses in this session that the hub reported.
  Losses own_losses_{};  ///< Losses in this session, on the consumer's side of ring or multicast.
  std::atomic<bool> reads_ring_{false};
  std::atomic<bool> receives_multicast_{false};
  std::atomic<bool> has_new_policy_{false};
  std::atomic<std::uint64_t> subscription_id_{0};
  std::atomic<bool> is_stopping_{false};
  std::atomic<std::thread::id> own_thread_{};
  /// The common reader's thread, while it calls the handler.
  std::atomic<std::thread::id> common_thread_{};
  // The next two members require the claimed seat.
  BroadcastSession* broadcast_ = nullptr;
  std::optional<SessionOutcome> broadcast_end_{};
  std::weak_ptr<ReaderSeat> seat_{};  ///< Requires mutex_.
  std::mutex join_mutex_;
  rt::Thread thread_{};
};

}  // namespace rtpm::events
