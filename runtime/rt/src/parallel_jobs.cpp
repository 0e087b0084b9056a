#include "rtpm/rt/parallel_jobs.hpp"

#include <utility>

namespace rtpm::rt {

ParallelJobs::ParallelJobs(std::string name, std::size_t thread_count_max)
    : name_(std::move(name)), thread_count_max_(thread_count_max) {}

ParallelJobs::~ParallelJobs() {
  finish();
  {
    const std::lock_guard lock(mutex_);
    is_ending_ = true;
  }
  changed_.notify_all();
  threads_.clear();
}

void ParallelJobs::add(std::function<void()> job) {
  {
    const std::lock_guard lock(mutex_);
    jobs_.push_back(std::move(job));
    if (idle_count_ < jobs_.size() && threads_.size() < thread_count_max_) {
      auto thread =
          Thread::start({.name = name_, .realtime = RealtimeMode::kOff}, [this] { serve(); });
      // If no new thread starts, the existing ones or finish() run the job.
      if (thread) threads_.push_back(std::move(*thread));
    }
  }
  changed_.notify_all();
}

void ParallelJobs::finish() {
  std::unique_lock lock(mutex_);
  while (!jobs_.empty() || running_count_ > 0) {
    if (threads_.empty()) {
      run_next(lock);
    } else {
      changed_.wait(lock);
    }
  }
}

void ParallelJobs::run_next(std::unique_lock<std::mutex>& lock) {
  const auto job = std::move(jobs_.front());
  jobs_.pop_front();
  ++running_count_;
  lock.unlock();
  job();
  lock.lock();
  --running_count_;
}

void ParallelJobs::serve() {
  std::unique_lock lock(mutex_);
  while (true) {
    ++idle_count_;
    changed_.wait(lock, [this] { return is_ending_ || !jobs_.empty(); });
    --idle_count_;
    if (jobs_.empty()) return;
    run_next(lock);
    changed_.notify_all();
  }
}

}  // namespace rtpm::rt
