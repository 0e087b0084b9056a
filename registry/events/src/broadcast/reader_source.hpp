#pragma once

#include <cstdint>

#include "rtpm/base/time.hpp"

namespace rtpm::events {

/// What several consumers of one program read together, and how their threads learn that there is
/// more.
/// @threads  any
/// @realtime alloc-free
class ReaderSource {
 public:
  virtual ~ReaderSource() = default;
  /// Another after each time that something came. To be taken before the last look at what one
  /// would sleep for.
  [[nodiscard]] virtual std::uint32_t value() const noexcept = 0;
  /// Sleeps until something came for one of `bits`, if nothing at all came since value() gave
  /// `seen`, or until `until`; wakes for nothing at times.
  virtual void sleep(std::uint32_t seen, std::uint32_t bits, MonotonicTime until) noexcept = 0;
  /// Wakes those who sleep for one of `bits`.
  virtual void ring(std::uint32_t bits) noexcept = 0;

  /// Whether what comes must be fetched by one of those who read it.
  [[nodiscard]] virtual bool must_be_fetched() const noexcept { return false; }
  /// As sleep(), for as long as need be, and fetches what comes, where that must be done; then
  /// those who sleep wake, too. One thread at a time fetches, and others wait for it to leave.
  virtual void fetch(std::uint32_t seen, std::uint32_t bits) noexcept { sleep(seen, bits, kNever); }
  /// Has the one who fetches leave, now or as soon as it begins.
  virtual void relieve() noexcept {}
  /// Nobody is to sleep or fetch any more.
  virtual void stop() noexcept { ring(~0U); }
};

}  // namespace rtpm::events
