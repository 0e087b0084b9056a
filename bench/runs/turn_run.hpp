#pragma once

#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "figures/disturbance.hpp"
#include "figures/report.hpp"
#include "figures/samples.hpp"
#include "runs/contender.hpp"
#include "runs/peer_contender.hpp"
#include "runs/peer_table.hpp"
#include "settings.hpp"

namespace rtpm::bench {

/// What a case has its contenders do.
struct CasePlan {
  std::string_view name;
  std::uint64_t sample_count = 0;   ///< Of each contender, if the run does not say.
  std::uint64_t warm_up_count = 0;  ///< Before each turn.
  std::uint64_t turn_size = 0;      ///< Calls of one contender before the next one's turn.
  double rest_part = 0;             ///< Of a turn's time, for which the CPUs then rest.
  int part_count = 1;               ///< Starts of all programs in a run.
  double rate_hz = 0;               ///< 0: one call after the other.
  CountFrom count_from = CountFrom::kSent;
  std::vector<int> low_caller_counts{0};  ///< Each is measured by itself.
  Duration work{0};                       ///< Of their calls.
};

/// RTPM, the raw floor and any number of peers, measured by turns in one run.
/// Threads: one at a time.
class TurnRun {
 public:
  /// What one contender showed with so many callers of low priority. Of events, `high` has all
  /// deliveries and `low` each event's last one.
  struct Finding {
    Samples high;
    Samples low;
  };
  struct Entrant {
    std::string title;  ///< Of a peer; none: RTPM or the floor.
    std::unique_ptr<Contender> contender{};
    const PeerContender* peer = nullptr;  ///< Null: RTPM or the floor, or between parts.
    std::map<int, Finding> findings{};
  };

  /// Refers to both.   Set-up only.
  TurnRun(const Settings& settings, const CasePlan& plan);

  /// The rounds of the run in the parts of the plan, for each of which come start_peers(),
  /// measure() and end_part().
  [[nodiscard]] std::vector<Rounds> parts() const;

  /// Starts those of the chosen peers that are built and that have a transport to be measured
  /// beside `carrier`: of calls (`verb` "call") or of events ("events"); after the first part,
  /// those that went through it. What fails is told. Before this process starts a thread.
  void start_peers(const PeerChoice& choice, std::string_view verb, Carrier carrier,
                   const PeerSetting& setting);
  [[nodiscard]] bool has_peers() const noexcept;

  /// Measures all by turns.   On a thread as run_as_caller() has it.
  [[nodiscard]] expected<void, std::string> measure(std::unique_ptr<Contender> rtpm,
                                                    std::unique_ptr<Contender> floor,
                                                    const Placement& placement, Rounds rounds);
  /// Ends all programs, and keeps what was found.
  void end_part();

  /// After measure(): RTPM, the floor, and the peers that went through.
  [[nodiscard]] const std::vector<Entrant>& entrants() const noexcept { return entrants_; }
  [[nodiscard]] const std::set<int>& low_caller_counts() const noexcept { return levels_; }
  /// Whether every peer that was started went through.
  [[nodiscard]] bool is_complete() const noexcept { return is_complete_; }

 private:
  static constexpr int kOwnCount = 2;  ///< RTPM and the floor, who stand first.

  Entrant& enter(const std::string& title);
  void start_peer(const PeerEntry& peer, const std::string& program, std::string_view verb,
                  const PeerSetting& setting);
  [[nodiscard]] expected<void, std::string> measure_level(int low_callers, int round);
  [[nodiscard]] expected<void, std::string> take_turn(Entrant& entrant, int low_callers,
                                                      std::uint64_t count);

  const Settings& settings_;
  const CasePlan& plan_;
  int round_count_;
  std::set<int> levels_;  ///< Numbers of low-priority callers.
  std::uint64_t count_per_round_ = 0;
  std::vector<Entrant> entrants_{};
  std::optional<StallDetector> detector_{};  ///< Within a part: its threads are in no fork's way.
  bool has_begun_ = false;                   ///< The first part has.
  bool is_complete_ = true;
};

}  // namespace rtpm::bench
