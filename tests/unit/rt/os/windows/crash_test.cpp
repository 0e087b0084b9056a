#include "rtpm/rt/crash.hpp"

#include <gtest/gtest.h>

#include <cstdlib>

#include "rtpm/rt/thread.hpp"

namespace rtpm::rt {
namespace {

using CrashDeathTest = testing::Test;

TEST(CrashDeathTest, NamesExceptionThreadAndWork) {
  EXPECT_DEATH(
      {
        report_crashes("the program", "call for help");
        static_cast<void>(Thread::start({.name = "worker"}, [] {
          const CrashNote note("the driver");
          static int* volatile nowhere = nullptr;
          *nowhere = 1;
        }));
      },
      "the program: exception 0xc0000005 .access violation. ends the process: thread worker, in "
      "the driver\\. Remedy: call for help\\.");
}

TEST(CrashDeathTest, ReportsAbort) {
  EXPECT_DEATH(
      {
        report_crashes("the program", "");
        std::abort();
      },
      "the program: signal 22 .aborted. ends the process");
}

}  // namespace
}  // namespace rtpm::rt
