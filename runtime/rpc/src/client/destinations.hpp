#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "client/endpoint.hpp"
#include "local/local.hpp"
#include "rtpm/base/latest.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rt/pi_mutex.hpp"

namespace rtpm::rpc {

/// A binding's object as calls reach it. Immutable.
struct Destination {
  Destination(Node& node_in, Endpoint& endpoint_in, std::string path_in, std::string url_in)
      : node(node_in), endpoint(endpoint_in), path(std::move(path_in)), url(std::move(url_in)) {}
  Destination(const Destination&) = delete;
  Destination& operator=(const Destination&) = delete;
  ~Destination();

  Node& node;
  Endpoint& endpoint;
  std::string path;
  std::string url;
  /// Null unless the object's server is in this program.
  std::shared_ptr<LocalDoor> door{};
  // Oneways lost on the way to the binding's previous destinations, and the endpoint's losses from
  // before the binding used it.
  std::uint64_t lost_before = 0;
  std::uint64_t lost_elsewhere = 0;
  [[nodiscard]] std::uint64_t lost_oneway_count() const noexcept {
    return lost_before + endpoint.lost_oneway_count() - lost_elsewhere;
  }
};

/// The result of a bind; valid while the server's epoch is the same.
struct Bound {
  const Destination* destination = nullptr;
  std::uint64_t server_epoch = 0;
  std::uint32_t service = 0;
  Priority priority{};
  bool is_server_declared = false;
  std::uint64_t fingerprint = 0;  ///< The server's fingerprint of the interface.
};

/// Where a binding's calls go: to one destination at a time. A binding by name may move to another
/// one; previous ones are kept while calls may use them.
/// @threads  settle(), settled() and free_former(): the binding thread; the rest: any
/// @realtime alloc-free except settle() and free_former()
class Destinations {
 public:
  /// @param may_change  false if the binding keeps one destination for life
  explicit Destinations(bool may_change) noexcept : may_change_(may_change) {}

  /// Keeps the destinations that get() returns alive. Costs nothing if there is only one for life.
  class Pin {
   public:
    explicit Pin(Destinations& all) noexcept : count_(all.may_change_ ? &all.pin_count_ : nullptr) {
      // SYNC POINT binding-destinations: a pin that the count does not include yet sees the newest
      // destination.
      if (count_ != nullptr) count_->fetch_add(1, std::memory_order_acq_rel);
    }
    Pin(const Pin&) = delete;
    Pin& operator=(const Pin&) = delete;
    ~Pin() {
      if (count_ != nullptr) count_->fetch_sub(1, std::memory_order_release);
    }

   private:
    std::atomic<std::uint32_t>* count_;
  };

  /// The last bind. Requires a settled destination.
  [[nodiscard]] Bound get() noexcept;
  /// Records a restart of the server at the destination. Ignored if calls have moved elsewhere
  /// meanwhile.
  void renew(const Bound& value) noexcept;
  /// Whether the destination has a door.
  [[nodiscard]] bool has_door() const noexcept { return has_door_.load(std::memory_order_relaxed); }

  /// Directs calls to `destination` from now on.
  void settle(std::unique_ptr<Destination> destination, const Bound& bound);
  [[nodiscard]] const Destination* settled() const noexcept { return settled_.get(); }
  /// Frees previous destinations unless an earlier call still uses them. True if none is left.
  [[nodiscard]] bool free_former() noexcept;

  /// Records that a oneway is about to be sent, so that a thread that detects its loss knows of it.
  void note_oneway() noexcept { sends_oneways_.store(true, std::memory_order_relaxed); }
  /// Whether this binding has sent oneways, and some to the server may have been lost since the
  /// last query.
  [[nodiscard]] bool has_lost_oneways() noexcept;

 private:
  const bool may_change_;
  Latest<Bound> bound_;
  rt::PiMutex writing_;                     ///< Guards bound_ and current_.
  const Destination* current_ = nullptr;    ///< The destination of bound_.
  std::unique_ptr<Destination> settled_{};  ///< Owns `current_`.
  std::atomic<bool> has_door_{false};
  std::vector<std::unique_ptr<Destination>> former_{};
  std::atomic<std::uint32_t> pin_count_{0};
  std::atomic<bool> sends_oneways_{false};
  /// How much of lost_oneway_count() the binding's callers have been told.
  std::atomic<std::uint64_t> lost_oneways_told_{0};
};

}  // namespace rtpm::rpc
