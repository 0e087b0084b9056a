#pragma once

#include <functional>
#include <map>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/wire/cookie.hpp"
#include "scheduler.hpp"

namespace rtpm::sim {

using Bytes = std::vector<std::byte>;

/// The network's treatment of datagrams.
struct NetworkProfile {
  std::uint64_t lost_per_mille = 0;
  std::uint64_t doubled_per_mille = 0;
  std::uint64_t late_per_mille = 0;  ///< Datagrams that come up to `late_max` later.
  /// Datagrams with up to two neighbouring bytes changed, which UDP's checksum always detects.
  std::uint64_t corrupted_per_mille = 0;
  bool has_checksum = true;
  std::uint64_t burst_per_mille = 0;  ///< A loss that is followed by others, for up to
  Duration burst_max{};               ///< this long.
  Duration delay_min{};
  Duration delay_max{};
  Duration late_max{};
};

/// Returns which of three hosts has the port.
[[nodiscard]] constexpr wire::PeerAddress address_of(std::uint32_t port) noexcept {
  return {.high = 0, .low = 0x7f00'0001 + port % 3, .port = port};
}

/// Carries datagrams between addresses: loses, doubles, delays and so reorders them.
class Network {
 public:
  using Receiver = std::function<void(const Bytes& frame, const wire::PeerAddress& from)>;

  Network(Scheduler& scheduler, Random& random, const NetworkProfile& profile)
      : scheduler_(scheduler), random_(random), profile_(profile) {}

  /// From now on `receiver` gets the datagrams for `port`; if it is null, they are dropped.
  void listen(std::uint32_t port, Receiver receiver) { receivers_[port] = std::move(receiver); }
  void send(std::uint32_t from_port, std::uint32_t to_port, ConstBytes frame);

  void set_profile(const NetworkProfile& profile) { profile_ = profile; }
  /// `tap` sees each datagram that is sent, and takes it if it returns false. Null removes the tap.
  void set_tap(std::function<bool(std::uint32_t, std::uint32_t, ConstBytes)> tap) {
    tap_ = std::move(tap);
  }
  /// Delivers `frame` to the receiver now, as if it came from `from_port`.
  void deliver(std::uint32_t from_port, std::uint32_t to_port, const Bytes& frame);
  void set_partitioned(bool is_partitioned) { is_partitioned_ = is_partitioned; }

 private:
  [[nodiscard]] Duration delay();
  [[nodiscard]] bool is_lost();
  [[nodiscard]] bool arrives_whole(Bytes& frame);

  Scheduler& scheduler_;
  Random& random_;
  NetworkProfile profile_;
  bool is_partitioned_ = false;
  MonotonicTime burst_end_{};
  std::map<std::uint32_t, Receiver> receivers_;
  std::function<bool(std::uint32_t, std::uint32_t, ConstBytes)> tap_;
};

}  // namespace rtpm::sim
