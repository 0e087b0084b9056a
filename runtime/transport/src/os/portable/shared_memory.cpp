#include "rtpm/transport/shared_memory.hpp"

// POSIX has no sealed memory to hand to another process, so calls on this host take UDP or TCP.
namespace rtpm::transport {
namespace {

unexpected<SetupError> no_shared_memory() {
  return setup_error("this system offers no calls through shared memory", "",
                     "call over UDP or TCP, or let RTPM choose (auto)");
}

}  // namespace

bool offers_shared_memory() noexcept {
  return false;
}

expected<SharedMemoryListener, SetupError> SharedMemoryListener::open(const SharedMemoryAddress&) {
  return no_shared_memory();
}

SharedMemoryListener::~SharedMemoryListener() = default;

Accepted SharedMemoryListener::accept() noexcept {
  return {};
}

SharedMemoryClient welcome_shared_memory_client(Descriptor, const UserPolicy*) {
  return {};
}

bool is_shared_memory_served(const SharedMemoryAddress&, MonotonicTime) noexcept {
  return false;
}

expected<std::unique_ptr<ClientTransport>, SetupError> open_shared_memory_transport(
    const SharedMemoryAddress&, Priority, MonotonicTime) {
  return no_shared_memory();
}

}  // namespace rtpm::transport
