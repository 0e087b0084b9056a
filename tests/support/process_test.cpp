#include "rtpm/test/process.hpp"

#include <gtest/gtest.h>
#include <signal.h>

#include <chrono>

namespace rtpm::test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

TEST(Process, SeparatesExitCodeOutputAndErrors) {
  const auto end = run({"sh", "-c", "echo out; echo err >&2; exit 3"}, seconds(10));
  ASSERT_TRUE(end);
  EXPECT_EQ(end->exit_code, 3);
  EXPECT_EQ(end->output, "out\n");
  EXPECT_EQ(end->errors, "err\n");
}

TEST(Process, WaitsForOutputAndForTheEnd) {
  Process process({"sh", "-c", "echo ready at 5; read line; cat"});
  EXPECT_TRUE(process.wait_for_output("ready at", seconds(10)));
  const auto end = process.wait(seconds(10));
  ASSERT_TRUE(end) << "its input is empty, so it ends";
  EXPECT_FALSE(process.wait_for_output("never said", seconds(10))) << "at once, for it has ended";
}

TEST(Process, GivesUpAtTheDeadline) {
  Process process({"sleep", "100"});
  EXPECT_FALSE(process.wait_for_output("anything", milliseconds(10)));
  EXPECT_FALSE(process.wait(milliseconds(10)));
  process.send_signal(SIGKILL);
  const auto end = process.wait(seconds(10));
  ASSERT_TRUE(end);
  EXPECT_FALSE(end->exit_code) << "a signal ended it";
}

TEST(Process, HidesVariablesThatWouldConfigureTheProgram) {
  setenv("RTPM_TEST_VARIABLE", "seen", 1);
  const auto end = run({"sh", "-c", "echo ${RTPM_TEST_VARIABLE-hidden}"}, seconds(10));
  unsetenv("RTPM_TEST_VARIABLE");
  ASSERT_TRUE(end);
  EXPECT_EQ(end->output, "hidden\n");
}

TEST(LineCount, CountsLines) {
  EXPECT_EQ(line_count(""), 0);
  EXPECT_EQ(line_count("one\ntwo\n"), 2);
}

}  // namespace
}  // namespace rtpm::test
