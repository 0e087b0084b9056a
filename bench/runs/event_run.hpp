#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "figures/report.hpp"
#include "figures/samples.hpp"
#include "rtpm/base/expected.hpp"
#include "settings.hpp"
#include "sides/event_board.hpp"
#include "sides/event_sides.hpp"

/// What the events case does alike with RTPM, the raw floor and every peer.
namespace rtpm::bench {

/// Events of one contender before the other's turn.
inline constexpr std::size_t kEventBlockSize = 50;

/// What one contender showed: each delivery, and of each event the last.
struct EventFinding {
  EventFinding(int round_count, std::size_t count, int consumer_count)
      : each(round_count, count * static_cast<std::size_t>(consumer_count)),
        last(round_count, count) {}
  void begin_round(int round) noexcept {
    each.begin_round(round);
    last.begin_round(round);
  }
  void note_disturbed(bool was_disturbed) noexcept {
    each.note_disturbed(was_disturbed);
    last.note_disturbed(was_disturbed);
  }

  Samples each;
  Samples last;
  std::uint64_t missing_count = 0;
  std::vector<Duration> all{};  ///< In the order of the events, where they are to be plotted.
};

/// Pushes `count` events, one every `period` and at most as many as the board has room for, and
/// takes what the first `consumer_count` consumers saw.
[[nodiscard]] expected<void, std::string> measure_events(Duration period, std::size_t count,
                                                         EventSide& side, EventBoard& board,
                                                         std::uint32_t block, int consumer_count,
                                                         EventFinding& finding);

/// What a result has as "delivery", where the hub sends once for all.
inline constexpr std::string_view kMulticast = "multicast";
/// What a result has as "hub", where that is of the supplier's program.
inline constexpr std::string_view kOwnHub = "supplier's";

/// "events, udp, block wait, 16 consumers".
[[nodiscard]] std::string title_of(const EventSetting& setting);

/// What a contender delivered.
struct Deliveries {
  const Samples& each;
  const Samples& last;
  std::uint64_t missing_count;
};
/// Adds the fields and rows of hub and relay beside each other.
void add_fan_out(Result& result, const Settings& settings, const EventSetting& setting,
                 const Deliveries& rtpm, const Deliveries& floor);

}  // namespace rtpm::bench
