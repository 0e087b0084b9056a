#pragma once

#include <atomic>
#include <memory>
#include <string>
#include <vector>

#include "duel.hpp"
#include "rtpm/rt/thread.hpp"

namespace rtpm::bench {

/// Callers of low priority that ask the server for work without pause, each on a thread of its own,
/// on the CPU of the measured caller, which their priority keeps out of its way.
/// Threads: one.   Set-up only.
class LowLoad {
 public:
  /// Connects as many callers as `config` says to the side whose turn it is.
  [[nodiscard]] static expected<std::unique_ptr<LowLoad>, std::string> connect(
      Duel& duel, const DuelConfig& config, Duration work);

  /// Starts the first `caller_count` callers and returns when each has had its first answer.
  [[nodiscard]] expected<void, std::string> start(int caller_count);
  /// Ends the callers' calling and gives back what they met: the latencies of their calls, or why
  /// one of them failed.
  [[nodiscard]] expected<std::vector<Duration>, std::string> stop();

 private:
  struct Member {
    std::unique_ptr<Caller> caller;
    std::vector<Duration> latencies;
    std::string failure;
    std::atomic<bool> has_begun{false};
    rt::Thread thread;
  };
  LowLoad(const DuelConfig& config, Duration work) : config_(config), work_(work) {}
  void run(Member& member);

  DuelConfig config_;
  Duration work_;
  std::atomic<bool> is_stopping_{false};
  std::vector<std::unique_ptr<Member>> members_;
};

}  // namespace rtpm::bench
