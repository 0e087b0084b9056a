#include "local/local_oneways.hpp"

#include <algorithm>
#include <cstring>

namespace rtpm::rpc {
namespace {

constexpr std::uint64_t kLowHalf = 0xffff'ffff;

// The next state of the free list's head.
constexpr std::uint64_t head_after(std::uint64_t head, std::uint32_t number) noexcept {
  return (((head >> 32) + 1) << 32) | number;
}

}  // namespace

LocalOneways::LocalOneways(std::uint32_t count, std::uint32_t message_size_max)
    : requests_(count * kSizeMax), replies_(message_size_max), next_free_(count) {
  const MutableBytes requests = requests_.bytes();
  // Without memory there are no slots, which callers see as overload.
  if (requests.size() < count * kSizeMax || replies_.bytes().empty()) return;
  // Touches the memory now, so that a slot's first use does not page-fault.
  if (!requests.empty()) std::memset(requests.data(), 0, requests.size());
  for (std::uint32_t i = 0; i < count; ++i)
    places_.emplace_back(requests.subspan(i * kSizeMax, kSizeMax), replies_.bytes(), *this, i + 1);
  for (std::uint32_t i = count; i-- > 0;)
    give_back(places_[i]);
}

LocalChannel* LocalOneways::take() noexcept {
  // SYNC POINT local-oneways: the lane finished with a slot before it released it.
  std::uint64_t head = first_free_.load(std::memory_order_acquire);
  while (true) {
    const auto number = static_cast<std::uint32_t>(head & kLowHalf);
    if (number == 0) return nullptr;
    const std::uint32_t next = next_free_[number - 1].load(std::memory_order_relaxed);
    if (first_free_.compare_exchange_weak(head, head_after(head, next), std::memory_order_acquire,
                                          std::memory_order_acquire)) {
      return &places_[number - 1];
    }
  }
}

void LocalOneways::give_back(const LocalChannel& place) noexcept {
  const std::uint32_t number = place.number();
  std::uint64_t head = first_free_.load(std::memory_order_relaxed);
  do {
    next_free_[number - 1].store(static_cast<std::uint32_t>(head & kLowHalf),
                                 std::memory_order_relaxed);
    // SYNC POINT local-oneways
  } while (!first_free_.compare_exchange_weak(
      head, head_after(head, number), std::memory_order_release, std::memory_order_relaxed));
}

}  // namespace rtpm::rpc
