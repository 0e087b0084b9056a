#include "laboratory/process.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <string>

#include "laboratory/guard.hpp"
#include "laboratory/process_tree.hpp"

// Starting, finding and ending programs of a laboratory.
namespace rtpm::laboratory {
namespace {

/// The output of a shell that runs like a laboratory's program.
std::string output_of(const std::string& script) {
  auto pipe = make_pipe();
  if (!pipe) return {};
  Launch description{.path = "/bin/sh",
                     .arguments = {"sh", "-c", script},
                     .environment = environment_with({{"RTPM_TOLD", "a b"}}),
                     .folder = "/",
                     .output = (*pipe)[1].number()};
  const auto process = launch(description);
  EXPECT_TRUE(process);
  (*pipe)[1].reset();
  std::string text;
  std::array<char, 4096> part{};
  for (ssize_t size = 0; (size = read((*pipe)[0].number(), part.data(), part.size())) > 0;)
    text.append(part.data(), static_cast<std::size_t>(size));
  waitpid(*process, nullptr, 0);
  return text;
}

TEST(Process, HasItsFolderEnvironmentAndGroup) {
  EXPECT_EQ(output_of("pwd; echo \"$RTPM_TOLD\""), "/\na b\n");
  const std::string group = output_of("ps -o pid= -o pgid= -p $$ | awk '{print $1 == $2}'");
  EXPECT_EQ(group, "1\n");
}

TEST(Process, HasNoDescriptorButThree) {
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
  const std::string status = output_of("grep -E 'Sig(Blk|Ign)' /proc/self/status | sort");
  signal(SIGHUP, handler);
  pthread_sigmask(SIG_SETMASK, &former, nullptr);
  EXPECT_EQ(status, "SigBlk:\t0000000000000000\nSigIgn:\t0000000000000000\n");
}

TEST(Process, ThatCannotBeStartedSaysWhy) {
  const auto absent = launch({.path = "/bin/rtpm-absent", .arguments = {"x"}, .folder = "/"});
  ASSERT_FALSE(absent);
  EXPECT_NE(absent.error().reason().find("/bin/rtpm-absent"), std::string::npos);
  EXPECT_EQ(absent.error().cause, system_error(ENOENT));
  const auto outside = launch({.path = "/bin/sh", .arguments = {"sh"}, .folder = "/nowhere"});
  ASSERT_FALSE(outside);
  EXPECT_NE(outside.error().reason().find("/nowhere can't be entered"), std::string::npos);
}

TEST(ProcessTree, TellsAProcessFromALaterOne) {
  const auto self = identity_of(getpid());
  ASSERT_TRUE(self);
  EXPECT_TRUE(send_signal(*self, 0));
  EXPECT_FALSE(send_signal({self->id, self->start_ticks + 1}, 0));
  EXPECT_FALSE(identity_of(-1));
}

/// Whether the process exists and is not a zombie.
bool is_alive(pid_t id) {
  return identity_of(id).has_value();
}

// SIGKILL ends both processes, one after the other; none of their child processes remains.
TEST(Guard, EndsWhatItsWorkLeavesBehind) {
  auto pipe = make_pipe();
  auto ready_pipe = make_pipe();
  ASSERT_TRUE(pipe && ready_pipe);
  const pid_t guard = fork();
  if (guard == 0) {
    const auto end = run_guarded(
        [&](int) {
          // A grandchild in its own session, which ignores SIGTERM.
          if (fork() == 0) {
            setsid();
            signal(SIGTERM, SIG_IGN);
            const pid_t own = getpid();
            static_cast<void>(!write((*pipe)[1].number(), &own, sizeof own));
            static_cast<void>(!write((*ready_pipe)[1].number(), &own, sizeof own));
            for (;;)
              pause();
          }
          // Reports ready only once it ignores SIGTERM.
          pid_t ready = 0;
          static_cast<void>(!read((*ready_pipe)[0].number(), &ready, sizeof ready));
          raise(SIGKILL);
          return 0;
        },
        std::chrono::milliseconds{50}, false);
    _exit(end && end->was_killed ? 7 : 1);
  }
  (*pipe)[1].reset();
  int status = 0;
  waitpid(guard, &status, 0);
  EXPECT_EQ(WEXITSTATUS(status), 7);
  pid_t grandchild = 0;
  ASSERT_EQ(read((*pipe)[0].number(), &grandchild, sizeof grandchild),
            static_cast<ssize_t>(sizeof grandchild));
  EXPECT_FALSE(is_alive(grandchild));
}

}  // namespace
}  // namespace rtpm::laboratory
