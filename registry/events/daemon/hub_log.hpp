#pragma once

#include <cstdint>
#include <vector>

#include "rtpm/events/hub.hpp"
#include "rtpm/events/link.hpp"
#include "rtpm/rt/log.hpp"

namespace rtpm::eventd {

/// Says on standard error what happens to a hub: a sentence for each consumer that is gone, unless
/// it unsubscribed, and for each link whose state changes; not more than a reader can follow.
/// @ownership refers to the hub
/// @threads  one, time-shared
class HubLog {
 public:
  explicit HubLog(const events::Hub& hub) : hub_(hub) {}
  /// Says what happened since it was last called.
  void write_disconnects();

 private:
  const events::Hub& hub_;
  rt::Log log_{"rtpm-eventd"};
  std::uint64_t disconnect_number_ = 0;
  std::vector<events::LinkState> link_states_{};
};

}  // namespace rtpm::eventd
