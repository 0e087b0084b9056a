#include "write_queue.hpp"

#include <utility>

namespace rtpm::names {
namespace {

bool is_own(std::uint32_t host) noexcept {
  return host >> 24 == 127;
}
// All loopback addresses are one host.
std::uint32_t key_of(std::uint32_t host) noexcept {
  return is_own(host) ? 0x7f00'0001 : host;
}

}  // namespace

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

bool WriteQueue::reserve(std::uint32_t host) {
  const std::lock_guard lock(mutex_);
  const std::size_t count_max = is_own(host) ? kCountOwnHostMax : kCountPerHostMax;
  const auto of_host = count_of_host_.find(key_of(host));
  const std::size_t held = of_host == count_of_host_.end() ? 0 : of_host->second;
  if (is_stopping_ || count_ >= kCountMax || held >= count_max) {
    ++overload_count_;
    return false;
  }
  ++count_;
  ++count_of_host_[key_of(host)];
  return true;
}

void WriteQueue::release(std::uint32_t host) {
  const std::lock_guard lock(mutex_);
  const auto of_host = count_of_host_.find(key_of(host));
  if (--of_host->second == 0) count_of_host_.erase(of_host);
  --count_;
}

void WriteQueue::add(std::uint32_t host, std::function<void()> change) {
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
