#include "host/wake_up.hpp"

#include <algorithm>
#include <cmath>

#include "rtpm/program/text.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/thread.hpp"

namespace rtpm::tool {
namespace {

using program::formatted;

constexpr Duration kWakeUpPeriod = std::chrono::milliseconds{1};
/// The highest lateness that counts as good: a 1 kHz loop then still has three quarters of its
/// cycle.
constexpr Duration kLateGood = kWakeUpPeriod / 4;

void measure(Duration time, const program::StopSignal& stop, LatencyHistogram& lateness) {
  MonotonicTime next = rt::now() + kWakeUpPeriod;
  for (const MonotonicTime end = rt::now() + time; next < end && !stop.is_requested();
       next = std::max(next + kWakeUpPeriod, rt::now())) {
    rt::sleep_until(next);
    lateness.record(rt::now() - next);
  }
}

double microseconds(Duration duration) {
  return std::chrono::duration<double, std::micro>(duration).count();
}

/// The percentage of wake-ups that were late by at most `limit`.
double percent_within(const LatencyHistogram& lateness, Duration limit) {
  double low = 0;
  double high = 100;
  for (int i = 0; i < 30; ++i) {
    const double middle = (low + high) / 2;
    (lateness.percentile(middle) <= limit ? low : high) = middle;
  }
  return low;
}

}  // namespace

rt::Finding judge(const WakeUps& wake_ups) {
  const LatencyHistogram& lateness = wake_ups.lateness;
  const Duration late = lateness.percentile(99.9);
  std::string text = formatted("1 of 1000 wake-ups is later than %.0f us", microseconds(late));
  if (late <= kLateGood) return {"wake-ups", rt::Severity::kGood, std::move(text)};
  const bool loses_cycles = late >= kWakeUpPeriod;
  return {"wake-ups", loses_cycles ? rt::Severity::kProblem : rt::Severity::kWarning,
          std::move(text),
          loses_cycles ? "a loop of 1 kHz loses a cycle each second, and more"
                       : "so much of each ms a loop of 1 kHz may miss",
          "mend what else is found here, the worst first; end other work, see it by: top"};
}

expected<WakeUps, SetupError> measure_wake_ups(Duration time, const program::StopSignal& stop) {
  WakeUps wake_ups{.is_realtime = true};
  const auto body = [&] { measure(time, stop, wake_ups.lateness); };
  rt::ThreadConfig config{.name = "rtpm-wake-up",
                          .priority = Priority{Priority::kHighest},
                          .realtime = rt::RealtimeMode::kRequire};
  auto thread = rt::Thread::start(config, body);
  if (!thread) {
    wake_ups.is_realtime = false;
    config.priority.reset();
    config.realtime = rt::RealtimeMode::kOff;
    thread = rt::Thread::start(config, body);
  }
  if (!thread) return unexpected{thread.error()};
  thread->join();
  return wake_ups;
}

std::string text_of(const WakeUps& wake_ups) {
  const LatencyHistogram& lateness = wake_ups.lateness;
  std::string text = formatted(
      "%llu wake-ups at 1 kHz, %s\n  late by p50 %.1f, p99 %.1f, p99.9 %.1f, max %.1f us\n",
      static_cast<unsigned long long>(lateness.count()),
      wake_ups.is_realtime ? "SCHED_FIFO" : "not real-time", microseconds(lateness.percentile(50)),
      microseconds(lateness.percentile(99)), microseconds(lateness.percentile(99.9)),
      microseconds(lateness.max()));
  double before = 0;
  for (Duration limit = std::chrono::microseconds{1};
       before < 100 && limit < std::chrono::seconds{2}; limit *= 2) {
    const bool is_last = lateness.max() <= limit;
    const double within = is_last ? 100 : percent_within(lateness, limit);
    const double share = within - before;
    before = within;
    if (share <= 0 && !is_last) continue;
    const auto width = static_cast<std::size_t>(std::ceil(share * 0.4));
    text += formatted("  to %8.0f us %7.2f %% ", microseconds(limit), share) +
            std::string(width, '#') + "\n";
  }
  return text;
}

Json json_of(const WakeUps& wake_ups) {
  const LatencyHistogram& lateness = wake_ups.lateness;
  return {{"is_realtime", wake_ups.is_realtime},
          {"count", lateness.count()},
          {"late_us",
           {{"p50", microseconds(lateness.percentile(50))},
            {"p99", microseconds(lateness.percentile(99))},
            {"p99_9", microseconds(lateness.percentile(99.9))},
            {"max", microseconds(lateness.max())}}}};
}

}  // namespace rtpm::tool
