#include "rtpm/transport/broadcast_memory.hpp"

// POSIX has no memory that others can only read and can't shrink, so events take other ways.
namespace rtpm::transport {
namespace {

unexpected<SetupError> not_offered() {
  return setup_error("this system offers no events through shared memory", "",
                     "deliver them over UDP or TCP (--delivery, as the hub's help says)");
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
  return not_offered();
}

expected<BroadcastDoor, SetupError> BroadcastDoor::open(std::uint64_t) {
  return not_offered();
}

void BroadcastDoor::let_in(const BroadcastMemory&) noexcept {}

expected<BroadcastView, SetupError> BroadcastView::open(std::uint64_t, MonotonicTime) {
  return not_offered();
}

}  // namespace rtpm::transport
