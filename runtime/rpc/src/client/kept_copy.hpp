#pragma once

#include <algorithm>
#include <bit>
#include <cstring>
#include <optional>

#include "rtpm/base/bytes.hpp"
#include "rtpm/rt/lazy_memory.hpp"
#include "rtpm/rt/memory.hpp"

namespace rtpm::rpc {

/// A copy of the bytes in `room`, which grows as far as it must; none if there is no memory for it.
/// @realtime alloc-free; set-up, when it grows
[[nodiscard]] inline std::optional<ConstBytes> keep_copy(rt::LazyMemory& room,
                                                         ConstBytes bytes) noexcept {
  constexpr std::size_t kSizeMin = 4096;
  if (room.bytes().size() < bytes.size()) {
    const rt::AllowAllocationScope is_allowed;
    room = rt::LazyMemory(std::bit_ceil(std::max(bytes.size(), kSizeMin)));
  }
  // The system may have none left, or a limit on what may be locked.
  if (room.bytes().size() < bytes.size()) return std::nullopt;
  if (!bytes.empty()) std::memcpy(room.bytes().data(), bytes.data(), bytes.size());
  return ConstBytes(room.bytes()).first(bytes.size());
}

}  // namespace rtpm::rpc
