#pragma once

#include <cstdint>
#include <vector>

#include "rtpm/events/event.hpp"
#include "rtpm/events/filter.hpp"
#include "rtpm/events/link.hpp"

namespace rtpm::events {

/// Writes what read_link_news() reads: kLinkNewsSize bytes.   RT: alloc-free.
void write_link_news(const LinkNews& news, MutableBytes to) noexcept;

/// What a link needs of the hub that it is of.   Threads: any.
class LinkHost {
 public:
  virtual ~LinkHost() = default;
  [[nodiscard]] virtual std::uint64_t host_epoch() const noexcept = 0;
  /// What its consumers want, but for those that the hub `peer` subscribed for: a hub is not asked
  /// for what it asks for itself. Set-up only.
  [[nodiscard]] virtual std::vector<Match> wishes_but_of(std::uint64_t peer) const = 0;
  /// Takes an event that came over a link, with its times on this hub's clock.   RT: alloc-free.
  virtual void take_linked(std::size_t link, const EventView& event) noexcept = 0;
  /// Tells the consumers who asked for it what became of a link.   RT: alloc-free.
  virtual void announce(std::size_t link, const LinkNews& news) noexcept = 0;
};

}  // namespace rtpm::events
