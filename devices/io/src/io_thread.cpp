#include "rtpm/device_io/io_thread.hpp"

#include <utility>

namespace rtpm::device_io {

expected<void, SetupError> IoThread::start(const rt::ThreadConfig& config,
                                           std::function<bool()> step) {
  stop();
  is_stopping_.store(false, std::memory_order_relaxed);
  auto thread = rt::Thread::start(config, [this, step = std::move(step)] {
    while (!is_stopping_.load(std::memory_order_relaxed) && step()) {
    }
  });
  if (!thread) return unexpected{thread.error()};
  thread_ = std::move(*thread);
  return {};
}

void IoThread::stop() noexcept {
  request_stop();
  thread_.join();
}

}  // namespace rtpm::device_io
