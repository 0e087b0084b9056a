#include "work/worker_pool.hpp"

#include <algorithm>
#include <utility>

namespace rtpm::console {

expected<void, SetupError> WorkerPool::start(const Config& config) {
  config_ = config;
  for (std::size_t i = 0; i < config.thread_count; ++i) {
    auto thread = rt::Thread::start({.name = config.name, .realtime = rt::RealtimeMode::kOff},
                                    [this] { serve(); });
    if (!thread) return unexpected{thread.error()};
    threads_.push_back(std::move(*thread));
  }
  return {};
}

bool WorkerPool::run(const std::string& target, std::function<void()> work) {
  const std::lock_guard lock(mutex_);
  if (is_stopping_ || jobs_.size() >= config_.queued_max) return false;
  jobs_.push_back({target, std::move(work)});
  changed_.notify_one();
  return true;
}

void WorkerPool::stop() {
  {
    const std::lock_guard lock(mutex_);
    is_stopping_ = true;
    jobs_.clear();
  }
  changed_.notify_all();
  threads_.clear();
}

std::deque<WorkerPool::Job>::iterator WorkerPool::next() {
  return std::ranges::find_if(jobs_, [this](const Job& job) {
    const auto found = running_.find(job.target);
    return found == running_.end() || found->second < config_.per_target_max;
  });
}

void WorkerPool::serve() {
  std::unique_lock lock(mutex_);
  while (true) {
    changed_.wait(lock, [this] { return is_stopping_ || next() != jobs_.end(); });
    if (is_stopping_) return;
    const auto found = next();
    const Job job = std::move(*found);
    jobs_.erase(found);
    ++running_[job.target];
    lock.unlock();
    job.work();
    lock.lock();
    if (--running_[job.target] == 0) running_.erase(job.target);
    // Queued work for this target may now run, on any thread.
    changed_.notify_all();
  }
}

}  // namespace rtpm::console
