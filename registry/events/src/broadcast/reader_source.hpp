#pragma once

#include <cstdint>

#include "rtpm/base/time.hpp"

namespace rtpm::events {

/// A source that several consumers of a program read together, and on which their threads wait.
/// @threads  any
class ReaderSource {
 public:
  virtual ~ReaderSource() = default;
  /// Changes with every arrival. Read it before the last check, then pass it to sleep().
  [[nodiscard]] virtual std::uint32_t value() const noexcept = 0;
  /// Sleeps until an arrival for any of `bits` or until `until`, unless value() no longer equals
  /// `seen`. May wake spuriously.
  virtual void sleep(std::uint32_t seen, std::uint32_t bits, MonotonicTime until) noexcept = 0;
  /// Wakes the sleepers for any of `bits`.
  virtual void ring(std::uint32_t bits) noexcept = 0;

  /// Whether a reader's thread must fetch arrivals.
  [[nodiscard]] virtual bool must_be_fetched() const noexcept { return false; }
  /// Sleeps like sleep(), without a deadline; if necessary also fetches arrivals, which wakes
  /// sleepers. One thread at a time fetches; others wait for it.
  virtual void fetch(std::uint32_t seen, std::uint32_t bits) noexcept { sleep(seen, bits, kNever); }
  /// Makes the fetching thread return, now or as soon as it starts.
  virtual void interrupt_fetch() noexcept {}
  /// Ends all sleeping and fetching.
  virtual void stop() noexcept { ring(~0U); }
};

}  // namespace rtpm::events
