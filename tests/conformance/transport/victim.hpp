#pragma once

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/types.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdint>

namespace rtpm::rpc::test {

/// A process that runs `body` until it is killed; the body sends numbers to the test.
class Victim {
 public:
  template <class Body>
  explicit Victim(Body body) {
    std::array<int, 2> ends{};
    if (pipe(ends.data()) != 0) return;
    child_ = fork();
    if (child_ == 0) {
      body([&](std::uint16_t number) {
        const ssize_t size = write(ends[1], &number, sizeof number);
        if (size != sizeof number) _exit(1);
      });
      _exit(0);
    }
    close(ends[1]);
    told_ = ends[0];
  }
  ~Victim() {
    kill();
    close(told_);
  }
  Victim(const Victim&) = delete;
  Victim& operator=(const Victim&) = delete;

  /// Waits for the next number from the body.
  std::uint16_t await_number() const {
    std::uint16_t number = 0;
    const ssize_t size = read(told_, &number, sizeof number);
    EXPECT_EQ(size, static_cast<ssize_t>(sizeof number)) << "the process ended before";
    return number;
  }
  /// Stops the process, and waits until the system has done so.
  void stop() const {
    EXPECT_EQ(::kill(child_, SIGSTOP), 0);
    int status = 0;
    while (waitpid(child_, &status, WUNTRACED) < 0 && errno == EINTR) {
    }
    EXPECT_TRUE(WIFSTOPPED(status));
  }
  void go_on() const { EXPECT_EQ(::kill(child_, SIGCONT), 0); }
  /// Ends the process like `kill -9`, and waits until the system has done so.
  void kill() {
    if (child_ <= 0) return;
    ::kill(child_, SIGKILL);
    int status = 0;
    while (waitpid(child_, &status, 0) < 0 && errno == EINTR) {
    }
    child_ = -1;
  }

 private:
  pid_t child_ = -1;
  int told_ = -1;
};

}  // namespace rtpm::rpc::test
