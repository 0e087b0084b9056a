#include "pty_board.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <pty.h>
#include <termios.h>
#include <unistd.h>

#include <array>
#include <filesystem>

#include "rtpm/base/assert.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::test {

PtyBoard::PtyBoard(SerialFault fault, std::uint64_t faulty_from, bool resets)
    : model_(fault, faulty_from), resets_(resets) {
  termios line{};
  ::cfmakeraw(&line);
  line.c_cflag |= CREAD | CS8;
  ::cfsetspeed(&line, B115200);
  int host_fd = -1;
  std::array<char, 128> node{};
  RTPM_ASSERT(::openpty(&fd_, &host_fd, node.data(), &line, nullptr) == 0, "no pseudo terminal");
  ::fcntl(fd_, F_SETFL, O_NONBLOCK);
  ::close(host_fd);
  static std::atomic<int> count{0};
  link_ = testing::TempDir() + "rtpm_board_" + std::to_string(::getpid()) + "_" +
          std::to_string(++count);
  std::filesystem::create_symlink(node.data(), link_);
  // libserialport finds a node by the link of its name in /sys/class/tty. A name that leads to the
  // same link from there and from /dev makes it open any terminal.
  port_ = "/dev/../../.." + link_;
  thread_ = std::thread([this] { run(); });
}

PtyBoard::~PtyBoard() {
  unplug();
  std::filesystem::remove(link_);
}

void PtyBoard::unplug() {
  is_stopping_ = true;
  if (thread_.joinable()) thread_.join();
}

void PtyBoard::run() {
  while (!is_stopping_) {
    pollfd file{fd_, POLLIN, 0};
    ::poll(&file, 1, 1);
    const bool is_open = (file.revents & POLLHUP) == 0;
    const std::lock_guard lock(mutex_);
    if (is_open && !is_open_) model_.open(rt::now(), resets_);
    is_open_ = is_open;
    turn();
    if (model_.is_unplugged()) break;
    if (!is_open) std::this_thread::sleep_for(std::chrono::milliseconds{1});
  }
  ::close(fd_);
  // Another supply still powers the board, so that its watchdog runs.
  const MonotonicTime end = rt::now() + std::chrono::milliseconds{150};
  for (bool is_on = true; is_on && rt::now() < end;) {
    std::this_thread::sleep_for(std::chrono::milliseconds{1});
    const std::lock_guard lock(mutex_);
    model_.advance(rt::now());
    is_on = model_.effort() != 0;
  }
}

void PtyBoard::turn() {
  std::array<std::byte, 256> bytes{};
  model_.advance(rt::now());
  const std::size_t size_max = std::min(bytes.size(), model_.capacity());
  const auto size = size_max > 0 ? ::read(fd_, bytes.data(), size_max) : 0;
  if (size > 0)
    static_cast<void>(
        model_.take(ConstBytes(bytes).first(static_cast<std::size_t>(size)), rt::now()));
  while (const std::size_t given = model_.give(bytes, rt::now())) {
    if (::write(fd_, bytes.data(), given) < 0) break;
  }
}

void PtyBoard::with(const std::function<void(SerialModel&)>& use) {
  const std::lock_guard lock(mutex_);
  use(model_);
}

bool PtyBoard::comes_to_rest() {
  const MonotonicTime end = rt::now() + std::chrono::seconds{2};
  while (rt::now() < end) {
    float effort = 0;
    with([&](SerialModel& model) { effort = model.effort(); });
    if (effort == 0) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds{1});
  }
  return false;
}

}  // namespace rtpm::test
