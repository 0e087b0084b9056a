#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "figures/samples.hpp"
#include "rtpm/base/expected.hpp"
#include "runs/turn.hpp"
#include "sides/server_process.hpp"

namespace rtpm::bench {

/// A contender's measurements. For calls: those measured and those of the load beside them. For
/// events: each delivery, and the last delivery of each event.
struct Finding {
  Samples first;
  Samples second;
  std::uint64_t missing_count = 0;  ///< Deliveries that did not come in time.

  void begin_round(int round) noexcept {
    first.begin_round(round);
    second.begin_round(round);
  }
  void note_disturbed(bool was_disturbed) noexcept {
    first.note_disturbed(was_disturbed);
    second.note_disturbed(was_disturbed);
  }
};

/// One of the contenders that are measured by turns: RTPM, the raw floor, or a peer.
/// @threads one
class Contender {
 public:
  Contender() = default;
  Contender(const Contender&) = delete;
  Contender& operator=(const Contender&) = delete;
  virtual ~Contender() = default;

  /// Lets its server run, makes the turn's calls, and stops the server again.
  [[nodiscard]] virtual expected<void, std::string> take_turn(const TurnPlan& plan,
                                                              Finding& finding) = 0;
};

/// Connects the contenders, RTPM first and the floor last, on the caller's thread; all that it
/// starts lives as long as this function.
using Contenders = std::vector<std::unique_ptr<Contender>>;
using Connect = std::function<expected<Contenders, std::string>()>;
/// Starts the servers of a part of a run, before this process has a thread.
using Start = std::function<expected<Connect, std::string>()>;

/// Servers that run as long as this object lives, and are stopped otherwise.
class Running {
 public:
  explicit Running(std::vector<const ServerProcess*> servers) : servers_(std::move(servers)) {
    for (const ServerProcess* server : servers_)
      server->resume();
  }
  Running(const Running&) = delete;
  Running& operator=(const Running&) = delete;
  ~Running() {
    for (const ServerProcess* server : servers_)
      server->pause();
  }

 private:
  std::vector<const ServerProcess*> servers_;
};

/// Calls to servers that run only in their own turns, with or without load.
class CallContender final : public Contender {
 public:
  /// @lifetime refers to the servers
  CallContender(std::vector<const ServerProcess*> servers, std::unique_ptr<Caller> high,
                std::unique_ptr<LowLoad> load = nullptr)
      : servers_(std::move(servers)), high_(std::move(high)), load_(std::move(load)) {}

  expected<void, std::string> take_turn(const TurnPlan& plan, Finding& finding) override {
    const Running running(servers_);
    return run_turn(plan, *high_, load_.get(), finding.first, finding.second);
  }

 private:
  std::vector<const ServerProcess*> servers_;
  std::unique_ptr<Caller> high_;
  std::unique_ptr<LowLoad> load_;
};

}  // namespace rtpm::bench
