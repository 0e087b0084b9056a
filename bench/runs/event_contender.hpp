#pragma once

#include <memory>
#include <string>
#include <utility>

#include "rtpm/rt/clock.hpp"
#include "runs/contender.hpp"
#include "sides/event_board.hpp"
#include "sides/event_sides.hpp"

namespace rtpm::bench {

/// A supplier and consumers, and where these note what they got.
struct EventLine {
  explicit EventLine(int consumer_count)
      : board(static_cast<std::size_t>(consumer_count), kEventBlockSize) {}

  EventBoard board;
  std::unique_ptr<EventSide> side{};  ///< Notes to the board, so it ends first.
  std::uint32_t block = 0;
  bool is_warm = false;  ///< An event went the whole way.
};

/// Events through a line, of which the first consumers count. Its Finding has each delivery and
/// each event's last one.
class EventContender final : public Contender {
 public:
  EventContender(std::shared_ptr<EventLine> line, int consumer_count)
      : line_(std::move(line)), consumer_count_(consumer_count) {}

  expected<void, std::string> take_turn(const TurnPlan& plan, Finding& finding) override {
    // Links between hubs take a moment.
    for (const MonotonicTime give_up = rt::now() + kPatience; !line_->is_warm;) {
      if (rt::now() > give_up) return unexpected{std::string("no event arrives")};
      Finding cold{Samples(1, 0), Samples(1, 0)};
      auto pushed = push({.count = kWarmUpCount, .period_ns = plan.period_ns}, cold);
      if (!pushed) return pushed;
      line_->is_warm = cold.first.count() > 0;
    }
    return push(plan, finding);
  }

 private:
  static constexpr std::uint64_t kWarmUpCount = 20;
  static constexpr Duration kPatience = std::chrono::seconds{5};

  expected<void, std::string> push(const TurnPlan& plan, Finding& finding) {
    return push_events(plan, *line_->side, line_->board, ++line_->block, consumer_count_,
                       finding.first, finding.second, finding.missing_count);
  }

  std::shared_ptr<EventLine> line_;
  int consumer_count_;
};

}  // namespace rtpm::bench
