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

/// The places in which oneways of a lane's own program wait and run: a bounded number, each with
/// room for a datagram's payload. A larger oneway takes a call channel of its caller.
/// @threads  any; what its methods write into the room for replies is the lane's own thread's
/// @realtime alloc-free, no lock, no syscall, but for construction
class LocalOneways {
 public:
  static constexpr std::size_t kSizeMax = wire::kDatagramPayloadSizeMax;

  LocalOneways(std::uint32_t count, std::uint32_t message_size_max);

  /// A free place, or null. The one that was used last is taken first, as it is warm.
  [[nodiscard]] LocalChannel* take() noexcept;
  void give_back(const LocalChannel& place) noexcept;

 private:
  rt::LazyMemory requests_;
  /// One for all, as it is never read; a lane of several threads has them write elsewhere.
  rt::LazyMemory replies_;
  std::deque<LocalChannel> places_;                    ///< Sized once, never moved.
  std::vector<std::atomic<std::uint32_t>> next_free_;  ///< The next free place of each place.
  /// Low half: the number of the first free place, from 1; 0 if none. High half: how often it
  /// changed, so that one that was taken and given back meanwhile is not mistaken for untouched.
  alignas(64) std::atomic<std::uint64_t> first_free_{0};
};

}  // namespace rtpm::rpc
