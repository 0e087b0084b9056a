#include "rtpm/program/stop_signal.hpp"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/types.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <thread>

namespace rtpm::program {
namespace {

using namespace std::chrono_literals;

/// Runs `body` in its own process, which alone receives its signals, and returns its exit code, or
/// -1 if a signal ended it.
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

INSTANTIATE_TEST_SUITE_P(Signals, StopSignalOf, testing::Values(SIGINT, SIGTERM, SIGHUP, SIGQUIT));

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

// This covers nohup, and the background jobs of a script.
TEST(StopSignal, LeavesIgnoredHangupsIgnored) {
  EXPECT_EQ(0, run_in_child([] {
              signal(SIGHUP, SIG_IGN);
              signal(SIGQUIT, SIG_IGN);
              const StopSignal stop;
              kill(getpid(), SIGHUP);
              kill(getpid(), SIGQUIT);
              return !stop.is_requested();
            }));
}

TEST(StopSignal, IsRequestedByLostOutputOfAPrintingProgram) {
  EXPECT_EQ(0, run_in_child([] {
              const StopSignal server;
              const StopSignal display(LostOutput::kRequestsEnd);
              const bool was_requested = display.is_requested();
              if (std::freopen("/dev/full", "w", stdout) == nullptr) return false;
              std::puts("lost");
              std::fflush(stdout);
              return !was_requested && display.is_requested() && display.wait_for(10s) &&
                     !server.is_requested() && !server.wait_for(1ms);
            }));
}

TEST(StandardStreams, ReportAWriteWithoutAReader) {
  EXPECT_EQ(0, run_in_child([] {
              int ends[2];
              if (pipe(ends) != 0) return false;
              close(ends[0]);
              return write(ends[1], "x", 1) < 0 && errno == EPIPE;
            }));
}

TEST(StandardStreams, ReportAWriteToATooLargeFile) {
  EXPECT_EQ(0, run_in_child([] {
              const rlimit limit{.rlim_cur = 0, .rlim_max = 0};
              std::FILE* const file = std::tmpfile();
              if (file == nullptr || setrlimit(RLIMIT_FSIZE, &limit) != 0) return false;
              return write(fileno(file), "x", 1) < 0 && errno == EFBIG;
            }));
}

}  // namespace
}  // namespace rtpm::program
