#include "waiting.hpp"

#include <algorithm>
#include <atomic>

#include "rtpm/rt/clock.hpp"

namespace rtpm::python {
namespace {

std::atomic<bool> is_ending{false};
std::atomic<int> returning_count{0};
std::thread::id ending_thread{};  // Written before is_ending.

}  // namespace

Released::~Released() {
  returning_count.fetch_add(1);
  if (is_ending.load() && std::this_thread::get_id() != ending_thread) {
    returning_count.fetch_sub(1);
    while (true)
      std::this_thread::sleep_for(std::chrono::hours{1});
  }
  PyEval_RestoreThread(state_);
  returning_count.fetch_sub(1);
}

std::optional<double> seconds_until(MonotonicTime time) {
  if (time == kNever) return std::nullopt;
  return std::chrono::duration<double>(std::max(time - rt::now(), Duration{0})).count();
}

void end_threads() {
  ending_thread = std::this_thread::get_id();
  is_ending.store(true);
  // Those that return already need the GIL.
  while (returning_count.load() > 0) {
    PyThreadState* const state = PyEval_SaveThread();
    std::this_thread::sleep_for(std::chrono::microseconds{100});
    PyEval_RestoreThread(state);
  }
}

}  // namespace rtpm::python
