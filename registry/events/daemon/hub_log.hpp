#pragma once

#include <cstdint>
#include <vector>

#include "rtpm/events/hub.hpp"
#include "rtpm/events/link.hpp"
#include "rtpm/rt/log.hpp"

namespace rtpm::eventd {

/// Writes a hub's disconnects (except unsubscriptions) and link changes to standard error,
/// rate-limited.
/// @ownership refers to the hub
/// @threads  one, time-shared
class HubLog {
 public:
  explicit HubLog(const events::Hub& hub) : hub_(hub) {}
  /// Writes what happened since the last call.
  void write_changes();

 private:
  const events::Hub& hub_;
  rt::Log log_{"rtpm-eventd"};
  std::uint64_t disconnect_number_ = 0;
  std::vector<events::LinkState> link_states_{};
};

}  // namespace rtpm::eventd
