#pragma once

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "figures/disturbance.hpp"
#include "figures/report.hpp"
#include "runs/peers.hpp"
#include "runs/turn.hpp"
#include "settings.hpp"

namespace rtpm::bench {

/// Connects RTPM's contenders first and the floor last, on the caller's thread; all that it starts
/// lives as long as this function.
using Contenders = std::vector<Contender>;
using Connect = std::function<Outcome<Contenders>()>;
/// Starts the servers of a part of a run, before this process has a thread.
using Start = std::function<Outcome<Connect>()>;

/// Runs `body` to its end on a thread like a measured caller's: high priority, on the clients' CPU.
/// @return the body's result
[[nodiscard]] Outcome<> run_as_caller(const Settings& settings,
                                      const std::function<Outcome<>()>& body);

/// How a run measures its contenders.
struct RunPlan {
  std::uint64_t sample_count = 0;   ///< Per contender, unless the settings state it.
  std::uint64_t warm_up_count = 0;  ///< Untimed calls before each turn.
  std::uint64_t turn_size = 0;      ///< Calls of one contender before the next one's turn.
  /// A round is one turn of each contender, instead of the settings' length: where the machine
  /// stood still, little is lost.
  bool is_round_a_turn = false;
  double rest_part = 0;  ///< The pause after each turn, as a fraction of the turn's time.
  /// Starts of the servers in a run. The place of a process's memory, and its cores of the host,
  /// move the figures of shared memory by a third; with one start that would affect all rounds.
  int part_count = 1;
  double rate_hz = 0;  ///< 0 if calls follow one another without pause.
  CountFrom count_from = CountFrom::kSent;
  std::vector<int> loads{0};  ///< Numbers of callers that load the server, each measured by itself.
  std::string load_field{};   ///< The load's name in a result; empty without a load.
  /// The names of a Finding's distributions in results; the second one of calls is the load's.
  std::vector<std::string> names{""};
};

/// RTPM, the raw floor and any number of peers, measured by turns.
/// @threads one
class Run {
 public:
  /// @lifetime refers to `settings` and `report`
  Run(const Settings& settings, RunPlan plan, Report& report);

  /// Adds the peers that are built and have a transport to be measured beside `carrier`: of calls
  /// (`verb` "call") or of events ("events"). If there is none, nothing is measured.
  void invite(std::vector<const PeerEntry*> peers, std::string verb, Carrier carrier,
              const PeerSetting& setting);

  /// Measures all rounds. A peer that fails is left out, and the report says so.
  [[nodiscard]] Outcome<> measure(const Start& start);

  /// Reports RTPM beside the floor, and each peer beside RTPM, under each load that was asked for.
  void report(const Json& head, const Json& tail = Json::object());
  /// The time that a contender's paced calls took together.
  [[nodiscard]] double paced_seconds() const;
  /// RTPM beside the floor.
  [[nodiscard]] Json result(const Json& head, int load = 0) const;

 private:
  struct Entrant {
    std::string peer{};       ///< The peer's name; empty for RTPM and the floor.
    std::string transport{};  ///< The peer's transport.
    std::map<int, Finding> findings{};
    Contender contender{};  ///< Within a part.
  };

  Entrant& enter(const std::string& peer, const std::string& transport);
  void start_peers(bool is_first_part);
  [[nodiscard]] Outcome<> measure_part(const Connect& connect, int begin, int end);
  [[nodiscard]] Outcome<> measure_round(int load, int round);
  [[nodiscard]] Outcome<> take_turn(Entrant& entrant, int load, std::uint64_t count);
  [[nodiscard]] Json result_of_peer(const Json& head, const Entrant& peer, int load) const;
  void add_pair(Json& result, const std::string& over_name, const Finding& over,
                const std::string& under_name, const Finding& under,
                const std::string& ratio_name) const;
  void add_load(Json& result, const std::string& prefix, const Entrant& entrant, int load) const;
  [[nodiscard]] bool is_asked(int load) const;

  const Settings& settings_;
  RunPlan plan_;
  Report& report_;
  int round_count_;
  std::uint64_t count_per_round_;
  std::vector<const PeerEntry*> peers_{};
  std::string peer_verb_{};
  Carrier peer_carrier_{};
  PeerSetting peer_setting_{};
  CpuTime cpu_time_ = read_cpu_time();
  std::vector<Entrant> entrants_{};          ///< RTPM, the floor, and the peers.
  bool has_begun_ = false;                   ///< Without any peer that was invited, it does not.
  std::optional<StallDetector> detector_{};  ///< Within a part: its threads are in no fork's way.
};

}  // namespace rtpm::bench
