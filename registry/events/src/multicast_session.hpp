#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "idl.hpp"
#include "local_queue.hpp"
#include "rtpm/events/multicast.hpp"
#include "rtpm/rt/wait.hpp"
#include "rtpm/transport/multicast.hpp"

namespace rtpm::events {

/// A consumer's end of a hub's multicast: receives, asks the hub for what is missing, and queues.
/// Ownership: a socket, and a queue of its own.   Threads: one.
class MulticastSession {
 public:
  using Outcome = SessionOutcome;

  /// Joins the hub's group; null if the hub has none, or the system does not let it.
  [[nodiscard]] static std::unique_ptr<MulticastSession> open(HubClient& client,
                                                              const std::string& interface,
                                                              Duration deadline);
  [[nodiscard]] std::uint64_t id() const noexcept { return id_; }
  /// Begins to read for a subscription, from the datagram `first` on. `client` is asked for
  /// repairs.
  void begin(std::shared_ptr<HubClient> client, std::uint64_t subscription, std::uint64_t first,
             const DeliveryPolicy& policy, Priority priority);
  void set_policy(const DeliveryPolicy& policy) { queue_.set_policy(policy); }

  /// Takes one delivery and calls deliver(span of EventView) with it. RT: but for repairs, which
  /// allocate, alloc-free.
  template <class Deliver>
  [[nodiscard]] Outcome take(Deliver deliver) {
    receive();
    if (const auto failed = fill_queue()) return *failed;
    if (queue_.take(deliver)) return Outcome::kDelivered;
    return is_gone_ ? Outcome::kGone : Outcome::kNothing;
  }
  /// Waits until more comes, a repair is due, or until `until`.
  void wait(rt::WaitStrategy strategy, MonotonicTime until) noexcept;
  /// Whether something came when it waited last.
  [[nodiscard]] bool has_more() const noexcept { return has_more_; }

  /// What was lost since begin(), on this side.
  [[nodiscard]] Losses losses() const noexcept;

 private:
  MulticastSession(transport::MulticastReceiver receiver, std::uint64_t id)
      : receiver_(std::move(receiver)), id_(id) {}
  void receive() noexcept;
  void repair_if_due();
  void repair(const MulticastReader::Gap& gap);
  [[nodiscard]] std::optional<Outcome> fill_queue();

  transport::MulticastReceiver receiver_;
  std::uint64_t id_;
  std::shared_ptr<HubClient> client_{};
  std::uint64_t subscription_ = 0;
  Priority priority_{};
  std::optional<MulticastReader> reader_{};
  MonotonicTime repair_due_ = kNever;  ///< When the hub is asked, if what is missing stays away.
  bool has_more_ = false;
  bool is_gone_ = false;
  LocalQueue queue_{};
  std::vector<EventView> group_{};
};

}  // namespace rtpm::events
