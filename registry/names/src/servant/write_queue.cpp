#include "servant/write_queue.hpp"

#include <utility>

#include "model/record.hpp"

namespace rtpm::names {
expected<void, SetupError> WriteQueue::start() {
  for (std::size_t i = 0; i < kThreadCount; ++i) {
    auto thread = rt::Thread::start({.name = "rtpm-names-w", .realtime = rt::RealtimeMode::kOff},
                                    [this] { run(); });
    if (!thread) return unexpected{std::move(thread.error())};
    threads_.push_back(std::move(*thread));
  }
  return {};
}

void WriteQueue::stop() {
  {
    const std::lock_guard lock(mutex_);
    is_stopping_ = true;
    waiting_.clear();
  }
  waking_.notify_all();
  threads_.clear();
}

bool WriteQueue::reserve(std::uint64_t host) {
  const std::lock_guard lock(mutex_);
  const std::size_t count_max = is_own_host(host) ? kCountOwnHostMax : kCountPerHostMax;
  const auto of_host = count_of_host_.find(own_host_as_one(host));
  const std::size_t held = of_host == count_of_host_.end() ? 0 : of_host->second;
  if (is_stopping_ || count_ >= kCountMax || held >= count_max) {
    ++overload_count_;
    return false;
  }
  ++count_;
  ++count_of_host_[own_host_as_one(host)];
  return true;
}

void WriteQueue::release(std::uint64_t host) {
  const std::lock_guard lock(mutex_);
  const auto of_host = count_of_host_.find(own_host_as_one(host));
  if (--of_host->second == 0) count_of_host_.erase(of_host);
  --count_;
}

void WriteQueue::add(std::uint64_t host, std::function<void()> change) {
  {
    const std::lock_guard lock(mutex_);
    waiting_.push_back({host, std::move(change)});
  }
  waking_.notify_one();
}

void WriteQueue::run() {
  for (;;) {
    Waiting next;
    {
      std::unique_lock lock(mutex_);
      waking_.wait(lock, [this] { return is_stopping_ || !waiting_.empty(); });
      if (is_stopping_) return;
      next = std::move(waiting_.front());
      waiting_.pop_front();
    }
    next.change();
    next.change = {};
    release(next.host);
  }
}

std::size_t WriteQueue::count() const {
  const std::lock_guard lock(mutex_);
  return count_;
}

std::uint64_t WriteQueue::overload_count() const {
  const std::lock_guard lock(mutex_);
  return overload_count_;
}

}  // namespace rtpm::names
