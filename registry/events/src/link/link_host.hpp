#pragma once

#include <cstdint>
#include <vector>

#include "rtpm/events/event.hpp"
#include "rtpm/events/filter.hpp"
#include "rtpm/events/link.hpp"

namespace rtpm::events {

/// Writes what read_link_report() reads: kLinkReportSize bytes.
/// @realtime alloc-free
void write_link_report(const LinkReport& report, MutableBytes to) noexcept;

/// What a link needs of the hub that it is of.
/// @threads  any
class LinkHost {
 public:
  virtual ~LinkHost() = default;
  [[nodiscard]] virtual std::uint64_t host_epoch() const noexcept = 0;
  /// What its consumers want, but for those that the hub `peer` subscribed for: a hub is not asked
  /// for what it asks for itself.
  /// @realtime set-up only
  [[nodiscard]] virtual std::vector<Match> interest_set_without(std::uint64_t peer) const = 0;
  /// Takes an event that came over a link, with its times on this hub's clock.
  /// @realtime alloc-free
  virtual void take_linked(std::size_t link, const EventView& event) noexcept = 0;
  /// Tells the consumers who asked for it what became of a link.
  /// @realtime alloc-free
  virtual void publish_link_report(std::size_t link, const LinkReport& report) noexcept = 0;
};

}  // namespace rtpm::events
