#include "runs/turn.hpp"

#include "rtpm/rt/clock.hpp"

namespace rtpm::bench {
namespace {

expected<void, std::string> call(const TurnPlan& plan, Caller& caller, Samples& samples) {
  for (std::uint64_t i = 0; i < plan.warm_up_count; ++i) {
    if (auto called = caller.echo(); !called) return called;
  }
  if (plan.period_ns > 0) {
    return call_paced(caller, Duration{plan.period_ns}, plan.count, plan.count_from, samples);
  }
  for (std::uint64_t i = 0; i < plan.count; ++i) {
    const MonotonicTime sent = rt::now();
    if (auto called = caller.echo(); !called) return called;
    samples.add(rt::now() - sent);
  }
  return {};
}

}  // namespace

expected<void, std::string> run_turn(const TurnPlan& plan, Caller& caller, LowLoad* load,
                                     Samples& high, Samples& low) {
  if (load == nullptr) return call(plan, caller, high);
  if (auto started = load->start(plan.low_caller_count); !started) {
    (void)load->stop();
    return started;
  }
  auto called = call(plan, caller, high);
  const auto latencies = load->stop();
  if (!called) return called;
  if (!latencies) return unexpected{latencies.error()};
  for (const Duration latency : *latencies)
    low.add(latency);
  return {};
}

}  // namespace rtpm::bench
