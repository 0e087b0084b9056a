#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>

#include "rtpm/base/time.hpp"
#include "rtpm/rt/pi_mutex.hpp"
#include "rtpm/rt/semaphore.hpp"

namespace rtpm::gvd {

/// Lets other threads run a job on the device between two of its cycles: on the device's thread if
/// that runs, otherwise at once.
/// @threads  is_waiting() and run() from the device's, the rest from any
/// @realtime is_waiting(): alloc-free, one load; run(): never waits, but takes its job's time; the
///           rest: set-up only
class DeviceJobs {
 public:
  /// How long a job waits for the device's thread.
  static constexpr Duration kPatience = std::chrono::milliseconds{100};

  /// Makes the device's thread run all jobs from now on. Waits for a job that runs without it.
  void begin();
  /// Records that the device's thread has ended.
  void end();
  /// Calls `work` and returns true, or returns false if the device's thread has not started it
  /// within `patience`: then it never runs. Waits for a job that has started.
  template <class Work>
  [[nodiscard]] bool perform(Work&& work, Duration patience = kPatience) {
    struct WorkJob final : Job {
      explicit WorkJob(Work& called) : work(called) {}
      void run() override { work(); }
      Work& work;
    } job(work);
    return perform_job(job, patience);
  }

  [[nodiscard]] bool is_waiting() const noexcept {
    return state_.load(std::memory_order_relaxed) == State::kOffered;
  }
  /// Runs the waiting job, if any.
  void run();

 private:
  class Job {
   public:
    Job() = default;
    Job(const Job&) = delete;
    Job& operator=(const Job&) = delete;
    virtual ~Job() = default;
    virtual void run() = 0;
  };
  enum class State : std::uint8_t { kNone, kOffered, kRunning };

  [[nodiscard]] bool perform_job(Job& job, Duration patience);

  /// Serializes perform(), begin() and end(); the device's thread never takes it.
  rt::PiMutex mutex_{};
  bool has_thread_ = false;
  Job* job_ = nullptr;
  std::atomic<State> state_{State::kNone};
  rt::Semaphore done_{};
};

}  // namespace rtpm::gvd
