#pragma once

#include <nanobind/nanobind.h>

#include <chrono>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

#include "errors.hpp"
#include "rtpm/base/time.hpp"

/// Waits that signals, such as Ctrl-C, end.
namespace rtpm::python {

/// How long a wait lasts before it checks the signals.
inline constexpr Duration kSlice = std::chrono::milliseconds{50};

/// A thread's way back to the interpreter. From the end of the program on, a thread other than the
/// ending one rests here for good: the interpreter would unwind it through C++ that can't be
/// unwound. Take the GIL within its lifetime.
/// @threads  one without the GIL
class Return {
 public:
  Return() noexcept;
  Return(const Return&) = delete;
  Return& operator=(const Return&) = delete;
  ~Return();
};

/// A scope of C++ that calls Python code, which other threads may interrupt. The end of the program
/// waits for it, and lets no further one begin, for Return's reason.
/// @threads  one that holds the GIL
class RunsPython {
 public:
  RunsPython() noexcept;
  RunsPython(const RunsPython&) = delete;
  RunsPython& operator=(const RunsPython&) = delete;
  ~RunsPython();
};

/// Releases the GIL for its lifetime, unlike nanobind's class also while the program ends: see
/// Return.
/// @threads  one that holds the GIL
class Released {
 public:
  Released() noexcept : state_(PyEval_SaveThread()) {}
  Released(const Released&) = delete;
  Released& operator=(const Released&) = delete;
  ~Released();

 private:
  PyThreadState* state_;
};

/// Lets no other thread return to the interpreter from now on, and waits shortly for those whose C++
/// calls Python code. Call it last, with the GIL.
void end_threads();
/// Forgets the other threads in a forked child, where they do not exist.
void forget_threads();

/// Seconds from now, not below 0; None if never.
[[nodiscard]] std::optional<double> seconds_until(MonotonicTime time);

/// Runs the interpreter's signal handlers.
/// @errors raises the handler's exception
inline void check_signals() {
  if (PyErr_CheckSignals() != 0) raise_python_error();
}

/// Calls `is_done` without the GIL until it returns true, and checks the signals in between.
/// `is_done` waits at most kSlice.
/// @errors raises the handler's exception
template <class Function>
void wait_in_slices(const Function& is_done) {
  while (true) {
    {
      const Released released;
      if (is_done()) return;
    }
    check_signals();
  }
}

/// The result of `work`, which runs on a thread of its own: for set-up that waits for others.
/// `work` owns all that it uses, because it goes on alone if a signal ends the wait.
/// @errors raises the handler's exception
template <class T>
T interruptible(std::function<T()> work) {
  struct State {
    std::mutex mutex{};
    std::condition_variable changed{};
    std::optional<T> result{};
  };
  const auto state = std::make_shared<State>();
  std::thread([state, work = std::move(work)]() mutable {
    auto result = work();
    work = nullptr;
    const std::lock_guard lock(state->mutex);
    state->result.emplace(std::move(result));
    state->changed.notify_one();
  }).detach();
  wait_in_slices([&] {
    std::unique_lock lock(state->mutex);
    return state->changed.wait_for(lock, kSlice, [&] { return state->result.has_value(); });
  });
  return *std::move(state->result);
}

}  // namespace rtpm::python
