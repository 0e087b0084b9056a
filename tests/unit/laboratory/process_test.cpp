#include "laboratory/process.hpp"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fcntl.h>

#include <string>

// Starting and ending programs of a laboratory.
namespace rtpm::laboratory {
namespace {

/// The output of a shell that runs like a laboratory's program.
std::string output_of(const std::string& script) {
  auto process = launch("/bin/sh", {"sh", "-c", script}, {{"RTPM_GIVEN", "a b"}}, "/", false);
  EXPECT_TRUE(process);
  waitpid(process->id, nullptr, 0);
  std::string text;
  read_lines(process->streams[0], true,
             [&](std::string_view line) { text += std::string(line) + "\n"; });
  return text;
}

TEST(Process, HasItsFolderEnvironmentAndGroup) {
  EXPECT_EQ(output_of("pwd; echo \"$RTPM_GIVEN\""), "/\na b\n");
  const std::string group = output_of("ps -o pid= -o pgid= -p $$ | awk '{print $1 == $2}'");
  EXPECT_EQ(group, "1\n");
}

TEST(Process, InheritsThreeDescriptorsOnly) {
  constexpr int kLeaked = 77;
  ASSERT_EQ(dup2(STDERR_FILENO, kLeaked), kLeaked);  // Without O_CLOEXEC.
  EXPECT_EQ(output_of("test -e /proc/$$/fd/77 || echo closed"), "closed\n");
  close(kLeaked);
}

TEST(Process, HasNoSignalBlockedOrIgnored) {
  sigset_t blocked;
  sigset_t former;
  sigemptyset(&blocked);
  sigaddset(&blocked, SIGTERM);
  pthread_sigmask(SIG_BLOCK, &blocked, &former);
  const auto handler = signal(SIGHUP, SIG_IGN);
  // Without signals 29 and above, of which glibc ignores two.
  const std::string status =
      output_of("awk '/Sig(Blk|Ign)/ {print substr($2, 10)}' /proc/self/status");
  signal(SIGHUP, handler);
  pthread_sigmask(SIG_SETMASK, &former, nullptr);
  EXPECT_EQ(status, "0000000\n0000000\n");
}

TEST(Process, SaysWhyItCannotBeStarted) {
  const auto absent = launch("/bin/rtpm-absent", {"x"}, {}, "/", false);
  ASSERT_FALSE(absent);
  EXPECT_NE(absent.error().reason().find("/bin/rtpm-absent"), std::string::npos);
  EXPECT_EQ(absent.error().cause, system_error(ENOENT));
  const auto outside = launch("/bin/sh", {"sh"}, {}, "/nowhere", false);
  ASSERT_FALSE(outside);
  EXPECT_NE(outside.error().reason().find("/nowhere"), std::string::npos);
}

TEST(Process, PrintsLinesAndAnUnfinishedOne) {
  EXPECT_EQ(output_of("echo out; printf end"), "out\nend\n");
}

// SIGKILL ends both processes, one after the other; none of their child processes remains.
TEST(Guard, EndsDescendantsOfItsKilledProcess) {
  std::array<int, 2> pipe{};
  std::array<int, 2> ready{};
  ASSERT_EQ(pipe2(pipe.data(), O_CLOEXEC), 0);
  ASSERT_EQ(pipe2(ready.data(), O_CLOEXEC), 0);
  const pid_t guard = fork();
  if (guard == 0) {
    const auto end = run_guarded(
        [&] {
          // A grandchild in its own session, which ignores SIGTERM.
          if (fork() == 0) {
            setsid();
            signal(SIGTERM, SIG_IGN);
            static_cast<void>(!write(ready[1], "r", 1));
            for (;;)
              pause();
          }
          // Dies only once the grandchild ignores SIGTERM.
          char byte = 0;
          static_cast<void>(!read(ready[0], &byte, 1));
          raise(SIGKILL);
          return 0;
        },
        std::chrono::milliseconds{50});
    _exit(end && !*end ? 7 : 1);
  }
  close(pipe[1]);
  int status = 0;
  waitpid(guard, &status, 0);
  EXPECT_EQ(WEXITSTATUS(status), 7);
  // The last process that has the other end of the pipe is gone.
  char byte = 0;
  EXPECT_EQ(read(pipe[0], &byte, 1), 0);
}

}  // namespace
}  // namespace rtpm::laboratory
