#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <mutex>
#include <string>
#include <vector>

#include "rtpm/rt/thread.hpp"

namespace rtpm::rt {

/// Runs blocking jobs concurrently, each on a time-shared thread, started in the order in which
/// they were added. Threads start on demand, up to a limit; jobs may add jobs.
/// @threads  add(): any; finish() and the destructor: one
/// @realtime set-up only
class ParallelJobs {
 public:
  /// @param name              the threads' name
  /// @param thread_count_max  the most jobs that run concurrently
  ParallelJobs(std::string name, std::size_t thread_count_max);
  ParallelJobs(const ParallelJobs&) = delete;
  ParallelJobs& operator=(const ParallelJobs&) = delete;
  /// Calls finish().
  ~ParallelJobs();

  void add(std::function<void()> job);
  /// Waits until every job has run. Runs jobs itself if no thread could start.
  void finish();

 private:
  void serve();
  void run_next(std::unique_lock<std::mutex>& lock);

  const std::string name_;
  const std::size_t thread_count_max_;
  std::mutex mutex_;  ///< Guards the members below; not for real-time threads.
  std::condition_variable changed_;
  std::deque<std::function<void()>> jobs_{};
  std::size_t idle_count_ = 0;
  std::size_t running_count_ = 0;
  bool is_ending_ = false;
  std::vector<Thread> threads_{};
};

}  // namespace rtpm::rt
