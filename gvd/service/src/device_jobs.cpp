#include "device_jobs.hpp"

#include <mutex>

#include "rtpm/rt/clock.hpp"

namespace rtpm::gvd {

void DeviceJobs::begin() {
  const std::lock_guard lock(mutex_);
  has_thread_ = true;
}

void DeviceJobs::end() {
  const std::lock_guard lock(mutex_);
  has_thread_ = false;
}

bool DeviceJobs::perform_job(Job& job, Duration patience) {
  const std::lock_guard lock(mutex_);
  if (!has_thread_) {
    job.run();
    return true;
  }
  job_ = &job;
  // SYNC POINT device-job: the device's thread sees the job, and this thread sees its results.
  state_.store(State::kOffered, std::memory_order_release);
  if (done_.wait_until(rt::now() + patience)) {
    // SYNC POINT device-job: this thread sees the job's results. ThreadSanitizer does not know
    // every wait of done_.
    return state_.load(std::memory_order_acquire) == State::kNone;
  }
  State offered = State::kOffered;
  if (state_.compare_exchange_strong(offered, State::kNone, std::memory_order_acq_rel)) {
    return false;
  }
  // The job has started, and refers to this thread's stack.
  while (!done_.wait_until(kNever)) {
  }
  return state_.load(std::memory_order_acquire) == State::kNone;
}

void DeviceJobs::run() {
  // SYNC POINT device-job
  State offered = State::kOffered;
  if (!state_.compare_exchange_strong(offered, State::kRunning, std::memory_order_acq_rel)) return;
  job_->run();
  state_.store(State::kNone, std::memory_order_release);
  done_.post();
}

}  // namespace rtpm::gvd
