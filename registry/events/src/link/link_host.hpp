#pragma once

#include <cstdint>
#include <vector>

#include "rtpm/events/event.hpp"
#include "rtpm/events/filter.hpp"
#include "rtpm/events/link.hpp"

namespace rtpm::events {

/// Encodes kLinkReportSize bytes for read_link_report().
/// @realtime alloc-free
void write_link_report(const LinkReport& report, MutableBytes to) noexcept;

/// A hub, as its links use it.
/// @threads  any
class LinkHost {
 public:
  virtual ~LinkHost() = default;
  [[nodiscard]] virtual std::uint64_t host_epoch() const noexcept = 0;
  /// The interest of its consumers, without the subscriptions of hub `peer`, which is not asked for
  /// its own interest.
  /// @realtime set-up only
  [[nodiscard]] virtual std::vector<Match> interest_set_without(std::uint64_t peer) const = 0;
  /// Accepts an event from a link, with times on this hub's clock.
  /// @realtime alloc-free
  virtual void take_linked(std::size_t link, const EventView& event) noexcept = 0;
  /// Publishes an event of kLinkType.
  /// @realtime alloc-free
  virtual void publish_link_report(std::size_t link, const LinkReport& report) noexcept = 0;
};

}  // namespace rtpm::events
