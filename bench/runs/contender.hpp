#pragma once

#include <memory>
#include <string>

#include "figures/samples.hpp"
#include "rtpm/base/expected.hpp"
#include "runs/duel.hpp"
#include "runs/turn.hpp"
#include "sides/low_load.hpp"

namespace rtpm::bench {

/// One of those who are measured by turns: RTPM, the raw floor, or a peer.
/// Threads: one.
class Contender {
 public:
  Contender() = default;
  Contender(const Contender&) = delete;
  Contender& operator=(const Contender&) = delete;
  virtual ~Contender() = default;

  /// Lets its server run, makes the turn's calls, and stops the server again.
  [[nodiscard]] virtual expected<void, std::string> take_turn(const TurnPlan& plan, Samples& high,
                                                              Samples& low) = 0;
};

/// RTPM or the floor, connected; both with `config.low_caller_count` callers of low priority whose
/// calls compute for `work`.   On a thread as run_as_caller() has it.   Set-up only.
/// Ownership: refers to `duel`.
[[nodiscard]] expected<std::unique_ptr<Contender>, std::string> connect_contender(
    Duel& duel, Side side, const DuelConfig& config, Duration work);

}  // namespace rtpm::bench
