#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

#include "outcome.hpp"
#include "settings.hpp"

namespace rtpm::bench {

/// Two hosts on one: two network namespaces that a pair of virtual Ethernet devices joins. They
/// have no names; the kernel removes them, with devices and rules, when the last process in one of
/// them and the holder of this object have ended. So nothing is left behind, however the run ends.
/// Threads: any, one at a time.   Set-up only.
class NetworkPair {
 public:
  enum class Host : std::uint8_t { kServer, kClient };
  /// From the range that RFC 2544 reserves for measuring devices.
  static constexpr std::string_view kServerAddress = "198.18.0.1";
  static constexpr std::string_view kClientAddress = "198.18.0.2";

  /// Errors: a missing right or a missing program `ip`, in words, with the remedy.
  [[nodiscard]] static Outcome<NetworkPair> create();
  NetworkPair(NetworkPair&& other) noexcept;
  NetworkPair& operator=(NetworkPair&&) = delete;
  ~NetworkPair();

  /// Moves the calling thread to a host: the sockets that it opens from now on, and the threads
  /// that it starts, are there.
  [[nodiscard]] Outcome<> enter(Host host) const;

 private:
  NetworkPair() = default;
  [[nodiscard]] static std::size_t index_of(Host host) { return static_cast<std::size_t>(host); }
  /// Runs `ip` with these arguments on a host.
  [[nodiscard]] Outcome<> run(Host host, const std::string& arguments) const;

  std::array<int, 2> namespaces_{-1, -1};  ///< Indexed by Host.
};

}  // namespace rtpm::bench
