#include <cerrno>
#include <memory>
#include <utility>

#include "os/linux/epoll_wait_set.hpp"
#include "os/linux/port_wait_set.hpp"

namespace rtpm::transport {
namespace {

template <class Set>
expected<std::unique_ptr<WaitSet>, SetupError> open_set(std::size_t source_count_max) {
  auto doorbell = os::Doorbell::open();
  if (!doorbell) return unexpected{no_descriptor("an event for a thread's doorbell", errno)};
  auto set = std::make_unique<Set>(source_count_max, std::move(*doorbell));
  if (auto opened = set->open_epoll(); !opened) return unexpected{std::move(opened.error())};
  return std::unique_ptr<WaitSet>(std::move(set));
}

}  // namespace

expected<std::unique_ptr<WaitSet>, SetupError> WaitSet::open(std::size_t source_count_max) {
  return open_set<EpollWaitSet>(source_count_max);
}

expected<std::unique_ptr<WaitSet>, SetupError> WaitSet::open_for_lane(
    std::size_t source_count_max) {
  return open_set<PortWaitSet>(source_count_max);
}

}  // namespace rtpm::transport
