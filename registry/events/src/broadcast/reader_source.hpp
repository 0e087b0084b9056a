#pragma once

#include <cstdint>

#include "rtpm/base/time.hpp"

namespace rtpm::events {

/// A source that several consumers of a program read together, and how their threads wait for it.
/// @threads  any
class ReaderSource {
 public:
  virtual ~ReaderSource() = default;
  /// Changes with every arrival. Read it before the last check, then pass it to sleep().
  [[nodiscard]] virtual std::uint32_t value() const noexcept = 0;
  /// Sleeps until an arrival for one of `bits` or until `until`, unless value() has changed from
  /// `seen`. Wakes spuriously.
  virtual void sleep(std::uint32_t seen, std::uint32_t bits, MonotonicTime until) noexcept = 0;
  /// Wakes the sleepers for one of `bits`.
  virtual void ring(std::uint32_t bits) noexcept = 0;

  /// Whether a reader's thread must fetch arrivals.
  [[nodiscard]] virtual bool must_be_fetched() const noexcept { return false; }
  /// Sleeps like sleep(), without a deadline; also fetches arrivals, if necessary, which wakes
  /// sleepers. One thread at a time fetches; other threads wait for it.
  virtual void fetch(std::uint32_t seen, std::uint32_t bits) noexcept { sleep(seen, bits, kNever); }
  /// Makes the fetching thread return, now or when it begins.
  virtual void interrupt_fetch() noexcept {}
  /// Ends all sleeping and fetching.
  virtual void stop() noexcept { ring(~0U); }
};

}  // namespace rtpm::events
