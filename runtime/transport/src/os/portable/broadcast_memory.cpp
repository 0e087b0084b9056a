#include "rtpm/transport/broadcast_memory.hpp"

// POSIX has no memory that others can only read and can't shrink, so events take other ways.
namespace rtpm::transport {
namespace {

unexpected<SetupError> no_broadcast_memory() {
  return setup_error(
      "this system offers no events through shared memory", "",
      "give the hub no ring (HubConfig::ring_size): events take streams, or multicast");
}

}  // namespace

bool offers_broadcast_memory() noexcept {
  return false;
}

SharedMapping::SharedMapping(int, std::size_t, Access) noexcept : bytes_{} {}

SharedMapping::~SharedMapping() = default;

std::optional<std::pair<BroadcastBell, Descriptor>> BroadcastBell::make() noexcept {
  return std::nullopt;
}

std::optional<BroadcastBell> BroadcastBell::map(int) noexcept {
  return std::nullopt;
}

void BroadcastBell::ring(std::uint32_t) noexcept {}

void BroadcastBell::sleep(std::uint32_t, std::uint32_t, MonotonicTime) noexcept {}

expected<BroadcastMemory, SetupError> BroadcastMemory::make(std::size_t) {
  return no_broadcast_memory();
}

expected<BroadcastDoor, SetupError> BroadcastDoor::open(std::uint64_t) {
  return no_broadcast_memory();
}

void BroadcastDoor::let_in(const BroadcastMemory&) noexcept {}

expected<BroadcastView, SetupError> BroadcastView::open(std::uint64_t, MonotonicTime) {
  return no_broadcast_memory();
}

}  // namespace rtpm::transport
