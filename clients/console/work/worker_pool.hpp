#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/rt/thread.hpp"

namespace rtpm::console {

/// Runs blocking calls on a few threads. Work for one target never occupies all of them, so a
/// server that does not answer delays only its own callers.
/// @threads  any
class WorkerPool {
 public:
  struct Config {
    std::string name = "console-work";
    std::size_t thread_count = 8;
    std::size_t per_target_max = 2;  ///< How many may run concurrently.
    std::size_t queued_max = 2048;
  };

  [[nodiscard]] expected<void, SetupError> start(const Config& config);
  WorkerPool() = default;
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;
  ~WorkerPool() { stop(); }

  /// Runs `work`, which must end within a bounded time, on one of the threads.
  /// @return false if the queue is full, or the pool has stopped; then `work` never runs
  [[nodiscard]] bool run(const std::string& target, std::function<void()> work);
  /// Waits for running work, and drops queued work.
  void stop();

 private:
  struct Job {
    std::string target{};
    std::function<void()> work{};
  };
  void serve();
  /// The first job whose target is not busy; end() if there is none.
  [[nodiscard]] std::deque<Job>::iterator next();

  Config config_{};
  std::mutex mutex_{};
  std::condition_variable changed_{};
  std::deque<Job> jobs_{};
  std::map<std::string, std::size_t> running_{};
  bool is_stopping_ = false;
  std::vector<rt::Thread> threads_{};
};

}  // namespace rtpm::console
