#include "runs/turn.hpp"

#include <algorithm>

#include "rtpm/rt/clock.hpp"

namespace rtpm::bench {
namespace {

using namespace std::chrono_literals;

/// How long the last event of a turn may take to arrive.
constexpr Duration kPatience = 500ms;

Outcome<> make_calls(const TurnPlan& plan, const Call& call, Samples& samples) {
  for (std::uint64_t i = 0; i < plan.warm_up_count; ++i) {
    if (auto called = call({}); !called) return called;
  }
  const Duration period{plan.period_ns};
  MonotonicTime due = rt::now() + period;
  for (std::uint64_t i = 0; i < plan.count; ++i, due += period) {
    MonotonicTime begin = rt::now();
    if (plan.period_ns > 0) {
      const bool is_late = begin > due;
      if (!is_late) rt::sleep_until(due);
      begin = plan.count_from == CountFrom::kDue || is_late ? due : rt::now();
    }
    if (auto called = call({}); !called) return called;
    samples.add(rt::now() - begin);
  }
  return {};
}

}  // namespace

Outcome<> run_turn(const TurnPlan& plan, const Call& caller, LowLoad* load, Finding& finding) {
  if (load == nullptr) return make_calls(plan, caller, finding.first);
  if (auto started = load->start(plan.low_caller_count); !started) {
    (void)load->stop();
    return started;
  }
  auto called = make_calls(plan, caller, finding.first);
  const auto latencies = load->stop();
  if (!called) return called;
  if (!latencies) return failure(latencies.error());
  for (const Duration latency : *latencies)
    finding.second.add(latency);
  return {};
}

Outcome<> push_events(const TurnPlan& plan, EventSide& side, EventBoard& board, std::uint32_t block,
                      int consumer_count, Finding& finding) {
  const auto consumers = static_cast<std::size_t>(consumer_count);
  const std::size_t count = std::min<std::size_t>(plan.count, board.event_count());
  board.begin(block);
  const Duration period{plan.period_ns};
  MonotonicTime due = rt::now() + period;
  for (std::uint32_t i = 0; i < count; ++i, due += period) {
    rt::sleep_until(due);
    const EventStamp stamp{.due_ns = to_ns(rt::now()), .block = block, .number = i};
    if (auto pushed = side.push(stamp); !pushed) return pushed;
  }
  const MonotonicTime give_up = rt::now() + kPatience;
  while (board.arrived_count() < consumers * count && rt::now() < give_up)
    rt::sleep_until(rt::now() + 1ms);
  for (std::size_t event = 0; event < count; ++event) {
    Duration latest{0};
    for (std::size_t consumer = 0; consumer < consumers; ++consumer) {
      const Duration latency = board.at(consumer, event);
      latest = std::max(latest, latency);
      if (latency > Duration{0}) {
        finding.first.add(latency);
      } else {
        ++finding.missing_count;
      }
    }
    finding.second.add(latest);
  }
  return {};
}

}  // namespace rtpm::bench
