#pragma once

#include <atomic>
#include <memory>
#include <string>
#include <vector>

#include "rtpm/rt/thread.hpp"
#include "settings.hpp"
#include "sides/caller.hpp"

namespace rtpm::bench {

/// Callers of low priority that call without pause, each on a thread of its own, on the CPU of the
/// measured caller, which preempts them by its priority.
/// @threads  one
/// @realtime set-up only
class LowLoad {
 public:
  /// @param work  how long the server computes for each call
  LowLoad(const Placement& placement, rt::RealtimeMode realtime, std::vector<Call> callers,
          Duration work);

  /// Starts the first `caller_count` callers and returns when each has had its first answer.
  [[nodiscard]] Outcome<> start(int caller_count);
  /// Ends the calls and returns their latencies, or why one of the callers failed.
  [[nodiscard]] Outcome<std::vector<Duration>> stop();

 private:
  struct Member {
    Call call;
    std::vector<Duration> latencies{};
    std::string failure{};
    std::atomic<bool> has_begun{false};
    rt::Thread thread{};
  };
  void run(Member& member);

  Placement placement_;
  rt::RealtimeMode realtime_;
  Duration work_;
  std::atomic<bool> is_stopping_{false};
  std::vector<std::unique_ptr<Member>> members_{};
};

}  // namespace rtpm::bench
