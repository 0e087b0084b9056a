#include "work/periodic_thread.hpp"

#include <utility>

namespace rtpm::console {

expected<void, SetupError> PeriodicThread::start(const std::string& name, Duration period,
                                                 std::function<void()> work) {
  auto thread = rt::Thread::start({.name = name, .realtime = rt::RealtimeMode::kOff},
                                  [this, period, work = std::move(work)] { run(period, work); });
  if (!thread) return unexpected{thread.error()};
  thread_ = std::move(*thread);
  return {};
}

void PeriodicThread::run(Duration period, const std::function<void()>& work) {
  std::unique_lock lock(mutex_);
  while (!is_stopping_) {
    is_awake_ = false;
    lock.unlock();
    work();
    lock.lock();
    changed_.wait_for(lock, period, [this] { return is_awake_ || is_stopping_; });
  }
}

void PeriodicThread::wake() {
  {
    const std::lock_guard lock(mutex_);
    is_awake_ = true;
  }
  changed_.notify_all();
}

void PeriodicThread::stop() {
  {
    const std::lock_guard lock(mutex_);
    is_stopping_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

}  // namespace rtpm::console
