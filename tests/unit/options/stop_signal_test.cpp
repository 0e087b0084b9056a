#include "rtpm/options/stop_signal.hpp"

#include <gtest/gtest.h>
#include <sys/types.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <thread>

namespace rtpm::options {
namespace {

using namespace std::chrono_literals;

/// Runs `body` in a process of its own, whose signals are its alone, and gives its exit code; -1 if
/// a signal ended it.
template <class Body>
int run_in_child(Body body) {
  const pid_t child = fork();
  if (child == 0) _exit(body() ? 0 : 1);
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

TEST(StopSignal, IsNotRequestedByItself) {
  EXPECT_EQ(0, run_in_child([] {
              const StopSignal stop;
              return !stop.is_requested() && !stop.wait_for(1ms) && !stop.wait_for(-1s);
            }));
}

class StopSignalOf : public testing::TestWithParam<int> {};

TEST_P(StopSignalOf, WakesEveryWaiterAndStaysSet) {
  const int signal = GetParam();
  EXPECT_EQ(0, run_in_child([signal] {
              const StopSignal stop;
              std::thread first([&] { stop.wait(); });
              std::thread second([&] {
                while (!stop.wait_for(10s)) {
                }
              });
              kill(getpid(), signal);
              first.join();
              second.join();
              stop.wait();
              return stop.is_requested() && stop.is_requested() && stop.wait_for(0s);
            }));
}

INSTANTIATE_TEST_SUITE_P(Signals, StopSignalOf, testing::Values(SIGINT, SIGTERM));

TEST(StopSignal, SurvivesASecondSignal) {
  EXPECT_EQ(0, run_in_child([] {
              {
                const StopSignal stop;
                kill(getpid(), SIGINT);
                stop.wait();
                kill(getpid(), SIGTERM);
              }
              kill(getpid(), SIGINT);
              return true;
            }));
}

}  // namespace
}  // namespace rtpm::options
