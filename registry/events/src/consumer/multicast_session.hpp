#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "broadcast/multicast.hpp"
#include "broadcast/multicast_feed.hpp"
#include "consumer/broadcast_session.hpp"
#include "idl.hpp"
#include "rtpm/transport/multicast.hpp"

namespace rtpm::events {

/// A consumer's end of a hub's multicast: receives, requests repair and queues.
/// @ownership a socket or, if shared, a feed; and its own queue
class MulticastSession final : public BroadcastSession {
 public:
  /// A hub's multicast.
  struct Facts {
    std::uint64_t id = 0;  ///< Changes at each start of the hub.
    transport::MulticastGroup group{};
  };
  /// Queries the hub; nullopt if it has no multicast.
  [[nodiscard]] static std::optional<Facts> ask(HubClient& client, const std::string& interface,
                                                Duration deadline);
  /// Joins the group with its own socket; null if the system refuses.
  [[nodiscard]] static std::unique_ptr<MulticastSession> open(const Facts& facts);
  /// Reads from the group's feed, starting now.
  MulticastSession(std::uint64_t id, std::shared_ptr<MulticastFeed> feed)
      : id_(id), feed_(std::move(feed)), position_(feed_->end()) {}
  [[nodiscard]] std::uint64_t id() const noexcept { return id_; }
  /// Reads for a subscription, from datagram `first` on; requests repair through `client`.
  void begin(std::shared_ptr<HubClient> client, std::uint64_t subscription, std::uint64_t first,
             const DeliveryPolicy& policy, Priority priority);

  void set_policy(const DeliveryPolicy& policy) override { queue_.set_policy(policy); }
  [[nodiscard]] Outcome take(const Taker& taker, Asking asking) override;
  [[nodiscard]] bool is_lacking() const noexcept override { return repair_due_ != kNever; }
  void wait(rt::WaitStrategy strategy, MonotonicTime until) noexcept override;
  [[nodiscard]] bool has_more() const noexcept override { return has_more_; }
  [[nodiscard]] std::uint32_t wake_bits() const noexcept override { return ~0U; }
  [[nodiscard]] Losses losses() const noexcept override;

 private:
  MulticastSession(std::uint64_t id, transport::MulticastReceiver receiver)
      : id_(id), receiver_(std::move(receiver)) {}
  [[nodiscard]] bool wait_for_more(MonotonicTime until) noexcept;
  [[nodiscard]] bool receive() noexcept;
  void repair_if_due(Asking asking);
  void repair(const MulticastReader::Gap& gap);
  [[nodiscard]] std::optional<Outcome> fill_queue(Asking asking);

  std::uint64_t id_;
  std::optional<transport::MulticastReceiver> receiver_{};  ///< nullopt if it reads the feed.
  std::shared_ptr<MulticastFeed> feed_{};
  std::uint64_t position_ = 0;  ///< Position in the feed.
  std::shared_ptr<HubClient> client_{};
  std::uint64_t subscription_ = 0;
  Priority priority_{};
  std::optional<MulticastReader> reader_{};
  MonotonicTime repair_due_ = kNever;  ///< When missing datagrams are requested.
  bool has_more_ = false;
  bool is_gone_ = false;
  LocalQueue queue_{};
  std::vector<EventView> group_{};
};

}  // namespace rtpm::events
