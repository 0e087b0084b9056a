#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <vector>

#include "local/local.hpp"
#include "rtpm/rt/lazy_memory.hpp"
#include "rtpm/wire/limits.hpp"

namespace rtpm::rpc {

/// The slots in which oneways from a lane's own program wait and run: a bounded number, each with
/// space for a datagram's payload. A larger oneway takes a call channel of its caller.
/// @threads  any; the reply buffer belongs to the lane's thread
/// @realtime alloc-free, no lock, no syscall, except construction
class LocalOneways {
 public:
  static constexpr std::size_t kSizeMax = wire::kDatagramPayloadSizeMax;

  LocalOneways(std::uint32_t count, std::uint32_t message_size_max);

  /// Takes a free slot, or null. Prefers the last used one, which is warm in the cache.
  [[nodiscard]] LocalChannel* take() noexcept;
  void give_back(const LocalChannel& place) noexcept;

 private:
  rt::LazyMemory requests_;
  /// One buffer for all slots, as replies are never read. A lane with several threads makes them
  /// write elsewhere.
  rt::LazyMemory replies_;
  std::deque<LocalChannel> places_;                    ///< Has a fixed size and never moves.
  std::vector<std::atomic<std::uint32_t>> next_free_;  ///< The next free place of each place.
  /// Low half: the number of the first free slot, from 1; 0 if none. High half: a change count, so
  /// that a slot taken and released meanwhile is not mistaken for untouched (ABA).
  alignas(64) std::atomic<std::uint64_t> first_free_{0};
};

}  // namespace rtpm::rpc
