#pragma once

#include <atomic>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "idl.hpp"
#include "link/link_host.hpp"
#include "rtpm/base/latest.hpp"
#include "rtpm/events/consumer.hpp"
#include "rtpm/events/link.hpp"
#include "rtpm/rt/thread.hpp"

namespace rtpm::events {

/// One link: a consumer at the other hub, and a time-shared thread "rtpm-link" that creates the
/// consumer, updates its interest, and reads the other hub's clock.
/// @ownership refers to its host and node, which must outlive it
/// @threads  any
class Link final : private EventHandler {
 public:
  Link(LinkHost& host, std::size_t number, rpc::Node& node, std::string target, LinkConfig config);
  Link(const Link&) = delete;
  Link& operator=(const Link&) = delete;
  ~Link() override;
  [[nodiscard]] expected<void, SetupError> start();

  /// Records that the host's interest has changed. Returns at once.
  void on_interest_changed();
  /// The status without the host's counters.
  [[nodiscard]] LinkStatus status() const;

 private:
  /// Offset of the other hub's clock.
  struct PeerTime {
    Duration offset{0};
    std::uint32_t uncertainty_ns = 0;
  };

  void on_events(std::span<const EventView> events) override;
  void on_notice(const Notice& notice) override;

  void run();
  void attend();
  [[nodiscard]] bool reach_peer();
  void read_clock(const HubFacts& facts);
  void subscribe();
  void update_interest_set();
  void set_state(LinkState state, std::string reason);

  LinkHost& host_;
  const std::size_t number_;
  rpc::Node& node_;
  const std::string target_;
  const LinkConfig config_;

  // Used by the thread only.
  std::optional<HubClient> client_{};
  std::vector<Match> asked_{};
  std::unique_ptr<Consumer> consumer_{};

  Latest<PeerTime> peer_time_{};
  mutable std::mutex mutex_;  ///< Guards the members below.
  std::condition_variable changed_;
  LinkStatus status_{};
  Losses earlier_losses_{};  ///< Losses of earlier consumers.
  bool has_changed_ = false;
  bool has_ended_ = false;  ///< The consumer ended: create a new one.
  bool is_stopping_ = false;
  rt::Thread thread_{};
};

}  // namespace rtpm::events
