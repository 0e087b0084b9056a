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

LowLoad::LowLoad(const Placement& placement, rt::RealtimeMode realtime, std::vector<Job> jobs)
    : placement_(placement), realtime_(realtime) {
  for (Job& job : jobs) {
    members_.push_back(std::make_unique<Member>());
    members_.back()->job = std::move(job);
    members_.back()->latencies.reserve(kLatencyCountMax);
  }
}

void LowLoad::run(Member& member) {
  while (!is_stopping_.load(std::memory_order_relaxed) && member.failure.empty()) {
    const MonotonicTime begin = rt::now();
    if (auto called = member.job(); !called) {
      member.failure = called.error();
    } else if (member.latencies.size() < kLatencyCountMax) {
      member.latencies.push_back(rt::now() - begin);
    }
    member.has_begun.store(true, std::memory_order_release);
  }
}

expected<void, std::string> LowLoad::start(int caller_count) {
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
    if (!thread) return unexpected{thread.error().text()};
    member->thread = std::move(*thread);
  }
  const MonotonicTime end = rt::now() + kBeginTimeout;
  for (auto& member : active) {
    while (!member->has_begun.load(std::memory_order_acquire)) {
      if (rt::now() > end) return unexpected{std::string("a low-priority caller got no answer")};
      rt::sleep_until(rt::now() + std::chrono::milliseconds{1});
    }
  }
  return {};
}

expected<std::vector<Duration>, std::string> LowLoad::stop() {
  is_stopping_.store(true, std::memory_order_relaxed);
  std::vector<Duration> latencies;
  std::string failure;
  for (auto& member : members_) {
    member->thread.join();
    if (!member->failure.empty()) failure = member->failure;
    latencies.insert(latencies.end(), member->latencies.begin(), member->latencies.end());
  }
  if (!failure.empty()) return unexpected{"a low-priority caller failed: " + failure};
  return latencies;
}

}  // namespace rtpm::bench
