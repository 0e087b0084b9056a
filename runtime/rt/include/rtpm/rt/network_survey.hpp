#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "rtpm/rt/finding.hpp"

/// The state of a host's network, as far as RTPM's defaults depend on it: facts, then judgements.
namespace rtpm::rt {

/// A network interface.
struct InterfaceFacts {
  std::string name{};
  bool is_up = false;
  bool is_loopback = false;
  bool has_multicast = false;
  friend bool operator==(const InterfaceFacts&, const InterfaceFacts&) = default;
};

/// The result of sending a datagram to a group and receiving it on this host.
enum class MulticastTrial : std::uint8_t { kReceived, kRefused, kNotSent, kNotReceived };

struct MulticastFacts {
  std::string group{};                       ///< "239.255.42.1".
  std::vector<InterfaceFacts> interfaces{};  ///< Sorted by name.
  std::string route{};                       ///< The interface for the group, if there is one.
  MulticastTrial trial = MulticastTrial::kReceived;
  std::string reason{};  ///< Why, for kRefused.
};

/// The program that listens at a port.
struct PortHolder {
  std::string transport{};  ///< "UDP" or "TCP".
  std::string program{};    ///< Empty if this user may not see it.
  int process_id = 0;       ///< 0 if this user may not see it.
};

struct PortFacts {
  std::uint16_t port = 0;
  std::string program{};  ///< The program that listens there by default: "rtpm-registryd".
  std::string option{};   ///< The option that chooses another port: "--port".
  bool answers = false;   ///< Whether an RTPM server answers there.
  std::optional<PortHolder> holder{};
};

/// Reads the interfaces and the route of `group` below `root`; "" is the system's root. The trial
/// is left to the caller.
/// @realtime set-up only
[[nodiscard]] MulticastFacts read_multicast(const std::string& root, const std::string& group);
/// The program that listens at `port` by UDP or TCP; nullopt if there is none.
/// @realtime set-up only
[[nodiscard]] std::optional<PortHolder> holder_of_port(const std::string& root, std::uint16_t port);

/// @realtime set-up only
[[nodiscard]] Finding judge_multicast(const MulticastFacts& facts);
[[nodiscard]] Finding judge_port(const PortFacts& facts);

}  // namespace rtpm::rt
