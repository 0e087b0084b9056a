#include "rtpm/rt/cpu_keeper.hpp"

#include "os/native_thread.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::rt {

expected<std::unique_ptr<CpuKeeper>, SetupError> CpuKeeper::start(const std::string& name,
                                                                  int cpu) {
  std::unique_ptr<CpuKeeper> keeper(new CpuKeeper);
  auto thread = Thread::start({.name = name, .cpus = {cpu}, .schedule = Schedule::kTimeShared},
                              [self = keeper.get()] { self->run(); });
  if (!thread) return unexpected{thread.error()};
  keeper->thread_ = std::move(*thread);
  return keeper;
}

CpuKeeper::~CpuKeeper() {
  is_ending_.store(true, std::memory_order_relaxed);
  call_.post();
}

void CpuKeeper::keep_until(MonotonicTime time) noexcept {
  const std::int64_t time_ns = to_ns(time);
  std::int64_t until_ns = until_ns_.load(std::memory_order_relaxed);
  while (until_ns < time_ns && !until_ns_.compare_exchange_weak(until_ns, time_ns)) {
  }
  // SYNC POINT keeper-call: the request is written before the call. One call covers all requests
  // until it is handled.
  if (!is_called_.exchange(true)) call_.post();
}

void CpuKeeper::run() noexcept {
  // A keeper that would compete with other threads must not run.
  if (!os::yield_to_all()) return;
  while (!is_ending_.load(std::memory_order_relaxed)) {
    static_cast<void>(call_.wait_until(kNever));
    // SYNC POINT keeper-call
    is_called_.store(false);
    while (to_ns(now()) < until_ns_.load() && !is_ending_.load(std::memory_order_relaxed)) {
    }
  }
}

}  // namespace rtpm::rt
