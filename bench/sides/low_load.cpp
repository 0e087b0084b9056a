#include "sides/low_load.hpp"

#include <span>
#include <utility>

#include "rtpm/rt/clock.hpp"

namespace rtpm::bench {
namespace {

/// More calls than a turn has time for, so that every latency is recorded.
constexpr std::size_t kLatencyCountMax = 200'000;
constexpr Duration kBeginTimeout = std::chrono::seconds{5};

}  // namespace

LowLoad::LowLoad(const Placement& placement, rt::RealtimeMode realtime, std::vector<Call> callers,
                 Duration work)
    : placement_(placement), realtime_(realtime), work_(work) {
  for (Call& call : callers) {
    members_.push_back(std::make_unique<Member>());
    members_.back()->call = std::move(call);
    members_.back()->latencies.reserve(kLatencyCountMax);
  }
}

void LowLoad::run(Member& member) {
  while (!is_stopping_.load(std::memory_order_relaxed) && member.failure.empty()) {
    const MonotonicTime begin = rt::now();
    if (auto called = member.call(work_); !called) {
      member.failure = called.error();
    } else if (member.latencies.size() < kLatencyCountMax) {
      member.latencies.push_back(rt::now() - begin);
    }
    member.has_begun.store(true, std::memory_order_release);
  }
}

Outcome<> LowLoad::start(int caller_count) {
  is_stopping_.store(false, std::memory_order_relaxed);
  const std::span active(members_.data(), static_cast<std::size_t>(caller_count));
  for (auto& member : members_) {
    member->latencies.clear();
    member->failure.clear();
  }
  for (auto& member : active) {
    member->has_begun.store(false, std::memory_order_relaxed);
    auto thread = rt::Thread::start({.name = "bench-low",
                                     .priority = kLowPriority,
                                     .cpus = {placement_.client_cpu},
                                     .realtime = realtime_},
                                    [this, target = member.get()] { run(*target); });
    if (!thread) return failure(thread.error());
    member->thread = std::move(*thread);
  }
  const MonotonicTime end = rt::now() + kBeginTimeout;
  for (auto& member : active) {
    while (!member->has_begun.load(std::memory_order_acquire)) {
      if (rt::now() > end) return failure("a low-priority caller got no answer");
      rt::sleep_until(rt::now() + std::chrono::milliseconds{1});
    }
  }
  return {};
}

Outcome<std::vector<Duration>> LowLoad::stop() {
  is_stopping_.store(true, std::memory_order_relaxed);
  std::vector<Duration> latencies;
  std::string reason;
  for (auto& member : members_) {
    member->thread.join();
    if (!member->failure.empty()) reason = member->failure;
    latencies.insert(latencies.end(), member->latencies.begin(), member->latencies.end());
  }
  if (!reason.empty()) return failure("a low-priority caller failed: " + reason);
  return latencies;
}

}  // namespace rtpm::bench
