#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "rtpm/base/time.hpp"
#include "rtpm/incidents/incident.hpp"

namespace rtpm::incidents {

/// Now, by both clocks, and the recording that runs.
struct Moment {
  MonotonicTime time{};
  std::uint64_t utc_ns = 0;
  std::string recording{};
};

/// Keeps the incidents. An incident opens once while its cause lasts and closes when it ends; a
/// cause that returns within kMergeTime continues it and raises its count.
/// @ownership a value
/// @threads  one
/// @realtime set-up only
class IncidentBook {
 public:
  /// Beyond it the oldest closed incident is dropped: first one that asks for nothing more, which
  /// is acknowledged or kInfo.
  static constexpr std::size_t kCountMax = 10'000;
  static constexpr Duration kMergeTime = std::chrono::seconds{1};
  /// How long a restored open incident waits for its cause to show again.
  static constexpr Duration kRestoredTime = std::chrono::seconds{5};

  /// Adds an incident of an earlier run, before the first observe().
  void restore(Incident incident);
  /// Takes all causes that last at `moment`.
  void observe(std::span<const Cause> causes, const Moment& moment);
  /// Takes an event that does not last. The same within kMergeTime is counted.
  void happen(const Cause& cause, const Moment& moment);
  /// @return whether there is such an incident that nobody has acknowledged before
  bool acknowledge(std::uint64_t id, std::string_view person, std::uint64_t utc_ns);

  [[nodiscard]] const std::map<std::uint64_t, Incident>& all() const noexcept { return incidents_; }
  /// The incidents that have changed since the last call.
  [[nodiscard]] std::vector<Incident> take_changed();
  [[nodiscard]] std::size_t open_count() const noexcept;
  /// Warnings and alarms that nobody has acknowledged.
  [[nodiscard]] std::size_t unseen_count() const noexcept;
  /// The newest alarm that nobody has acknowledged; 0: none.
  [[nodiscard]] std::uint64_t newest_unseen_alarm() const noexcept;
  /// Incidents dropped beyond kCountMax.
  [[nodiscard]] std::uint64_t dropped_count() const noexcept { return dropped_count_; }

 private:
  using Key = std::pair<std::string, std::string>;
  struct Current {
    std::uint64_t id = 0;
    std::optional<MonotonicTime> ended{};
    bool is_restored = false;
  };
  Incident& open(const Cause& cause, const Moment& moment);
  void drop_oldest();

  std::map<std::uint64_t, Incident> incidents_{};
  std::map<Key, Current> current_{};  ///< Open incidents, and those closed a moment ago.
  std::set<std::uint64_t> changed_{};
  std::uint64_t last_id_ = 0;
  std::uint64_t dropped_count_ = 0;
  std::optional<MonotonicTime> begin_{};
};

}  // namespace rtpm::incidents
