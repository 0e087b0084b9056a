#include <cerrno>
#include <utility>

#include "rtpm/transport/socket.hpp"
#include "waiting/poll_wait_set.hpp"

namespace rtpm::transport {

expected<std::unique_ptr<WaitSet>, SetupError> WaitSet::open(std::size_t source_count_max) {
  auto doorbell = os::Doorbell::open();
  if (!doorbell) return unexpected{no_descriptor("a pipe for a thread's doorbell", errno)};
  return std::unique_ptr<WaitSet>(
      std::make_unique<PollWaitSet>(source_count_max, std::move(*doorbell)));
}

expected<std::unique_ptr<WaitSet>, SetupError> WaitSet::open_for_lane(
    std::size_t source_count_max) {
  return open(source_count_max);
}

}  // namespace rtpm::transport
