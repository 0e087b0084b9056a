#include "rtpm/program/terminal.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <stdlib.h>
#include <sys/ioctl.h>
#include <sys/wait.h>
#include <unistd.h>

namespace rtpm::program {
namespace {

/// The width that a process sees if `output` is its standard output.
int width_seen_on(int output) {
  const pid_t child = fork();
  if (child == 0) {
    dup2(output, STDOUT_FILENO);
    _exit(static_cast<int>(terminal_width(77)));
  }
  int status = 0;
  waitpid(child, &status, 0);
  return WEXITSTATUS(status);
}

TEST(TerminalWidth, IsTheTerminalsElseTheDefault) {
  const int terminal = posix_openpt(O_RDWR | O_NOCTTY);
  ASSERT_GE(terminal, 0);
  ASSERT_EQ(grantpt(terminal), 0);
  ASSERT_EQ(unlockpt(terminal), 0);
  const int program_side = open(ptsname(terminal), O_RDWR | O_NOCTTY);
  ASSERT_GE(program_side, 0);
  EXPECT_EQ(width_seen_on(program_side), 77) << "it does not tell";
  const winsize size{.ws_row = 40, .ws_col = 140, .ws_xpixel = 0, .ws_ypixel = 0};
  ASSERT_EQ(ioctl(terminal, TIOCSWINSZ, &size), 0);
  EXPECT_EQ(width_seen_on(program_side), 140);
  const int file = open("/dev/null", O_WRONLY);
  EXPECT_EQ(width_seen_on(file), 77);
  for (const int descriptor : {terminal, program_side, file})
    close(descriptor);
}

}  // namespace
}  // namespace rtpm::program
