#include "waiting.hpp"

#include <algorithm>
#include <atomic>

#include "rtpm/rt/clock.hpp"

namespace rtpm::python {
namespace {

std::atomic<bool> is_ending{false};
std::atomic<int> returning_count{0};
std::atomic<int> running_count{0};
thread_local int running_depth = 0;
std::thread::id ending_thread{};  // Written before is_ending.

/// How long the end waits for Python code that C++ calls.
constexpr Duration kPatience = 10 * kSlice;

bool must_rest() noexcept {
  return is_ending.load() && std::this_thread::get_id() != ending_thread;
}

/// Ends a thread's part in the program; it must not hold the GIL.
[[noreturn]] void rest() noexcept {
  running_count.fetch_sub(running_depth);
  while (true)
    std::this_thread::sleep_for(std::chrono::hours{1});
}

}  // namespace

Return::Return() noexcept {
  returning_count.fetch_add(1);
  if (!must_rest()) return;
  returning_count.fetch_sub(1);
  rest();
}

Return::~Return() {
  returning_count.fetch_sub(1);
}

RunsPython::RunsPython() noexcept {
  if (must_rest()) {
    PyEval_SaveThread();
    rest();
  }
  ++running_depth;
  running_count.fetch_add(1);
}

RunsPython::~RunsPython() {
  --running_depth;
  running_count.fetch_sub(1);
}

Released::~Released() {
  const Return gate;
  PyEval_RestoreThread(state_);
}

void forget_threads() {
  returning_count.store(0);
  running_count.store(running_depth);
}

std::optional<double> seconds_until(MonotonicTime time) {
  if (time == kNever) return std::nullopt;
  return std::chrono::duration<double>(std::max(time - rt::now(), Duration{0})).count();
}

void end_threads() {
  ending_thread = std::this_thread::get_id();
  is_ending.store(true);
  // Both need the GIL to go on.
  const MonotonicTime end = rt::now() + kPatience;
  while (returning_count.load() > 0 || (running_count.load() > 0 && rt::now() < end)) {
    PyThreadState* const state = PyEval_SaveThread();
    std::this_thread::sleep_for(std::chrono::microseconds{100});
    PyEval_RestoreThread(state);
  }
}

}  // namespace rtpm::python
