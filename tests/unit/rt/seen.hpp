#pragma once

#include <gtest/gtest.h>

#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "rtpm/rt/priority.hpp"
#include "rtpm/rt/thread.hpp"
#include "rtpm/test/os.hpp"

namespace rtpm::rt {

/// A thread's own state at the beginning of its body.
struct Seen {
  std::string name;
  test::Scheduling scheduling{};
  std::vector<int> cpus;
  std::optional<Priority> priority;
};

[[nodiscard]] inline Seen state_of_this_thread() {
  return {test::name_of_this_thread(), test::scheduling_of_this_thread(),
          test::cpus_of_this_thread(), current_priority()};
}

/// Starts a thread with `config` and returns what its body saw; fails the test if it did not start.
[[nodiscard]] inline Seen seen_by(const ThreadConfig& config) {
  Seen seen;
  auto thread = Thread::start(config, [&] { seen = state_of_this_thread(); });
  EXPECT_TRUE(thread) << thread.error().text();
  if (thread) thread->join();
  return seen;
}

/// Runs `body` on its own thread, which ends with the priority that it has then.
template <class Body>
void on_a_thread(Body body) {
  std::thread(body).join();
}

}  // namespace rtpm::rt
