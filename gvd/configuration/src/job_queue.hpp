#pragma once

#include <cstddef>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

#include "configurator.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/rt/pi_mutex.hpp"
#include "rtpm/rt/semaphore.hpp"

namespace rtpm::gvd {

/// A request that waits for the manager's thread.
class Job {
 public:
  Job() = default;
  Job(const Job&) = delete;
  Job& operator=(const Job&) = delete;
  virtual ~Job() = default;
  virtual void run(Configurator& configurator, MonotonicTime now) = 0;
  /// Called instead of run() if the queue is full.
  virtual void refuse() = 0;
};

/// Passes requests from lanes to the manager's thread.
/// @threads  post() and ring() from any, the others from one
/// @realtime set-up only
class JobQueue {
 public:
  static constexpr std::size_t kSizeMax = 64;

  /// Refuses the job if the queue is full.
  void post(std::unique_ptr<Job> job) {
    {
      const std::lock_guard lock(mutex_);
      if (jobs_.size() < kSizeMax) jobs_.push_back(std::move(job));
    }
    if (job != nullptr) {
      job->refuse();
    } else {
      ring();
    }
  }
  /// Ends the current wait.
  void ring() noexcept { doorbell_.post(); }
  /// Waits for post() or ring() until `deadline`, and takes all jobs.
  [[nodiscard]] std::vector<std::unique_ptr<Job>> wait_until(MonotonicTime deadline) {
    static_cast<void>(doorbell_.wait_until(deadline));
    const std::lock_guard lock(mutex_);
    return std::exchange(jobs_, {});
  }

 private:
  rt::PiMutex mutex_{};
  rt::Semaphore doorbell_{};
  std::vector<std::unique_ptr<Job>> jobs_{};
};

}  // namespace rtpm::gvd
