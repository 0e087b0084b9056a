#include "driver_process.hpp"

#include <fcntl.h>
#include <poll.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <mutex>
#include <new>
#include <utility>

#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/native_time.hpp"

namespace rtpm::driver_host {
namespace {

constexpr Duration kEndPatience = std::chrono::seconds{1};

std::error_code last_error() {
  return {errno, std::generic_category()};
}

unexpected<SetupError> not_started(const std::string& what) {
  return setup_error("a driver's process can't be started: " + what, last_error(),
                     "close programs, or raise the limits of open files and processes (ulimit)");
}

/// Moves the handle above the descriptor numbers that the process gets, so that dup2() overwrites
/// none of them.
Handle lifted(Handle handle) {
  return Handle(::fcntl(handle.number(), F_DUPFD_CLOEXEC, kMemoryHandle + 1));
}

struct Ends {
  Handle own;
  Handle others;
};
std::optional<Ends> make_sockets() {
  std::array<int, 2> ends{};
  if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) != 0) return std::nullopt;
  return Ends{Handle(ends[0]), lifted(Handle(ends[1]))};
}

/// Starts `command` with its three handles.
int spawn(const std::vector<std::string>& command, const Handle& control, const Handle& calibration,
          const Handle& memory, pid_t& number) {
  std::vector<char*> words;
  for (const std::string& word : command)
    words.push_back(const_cast<char*>(word.c_str()));
  words.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  ::posix_spawn_file_actions_init(&actions);
  ::posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  // A driver's standard output must not mix with that of its server.
  ::posix_spawn_file_actions_adddup2(&actions, STDERR_FILENO, STDOUT_FILENO);
  ::posix_spawn_file_actions_adddup2(&actions, control.number(), kControlHandle);
  ::posix_spawn_file_actions_adddup2(&actions, calibration.number(), kCalibrationHandle);
  ::posix_spawn_file_actions_adddup2(&actions, memory.number(), kMemoryHandle);
  const int error = ::posix_spawn(&number, words.front(), &actions, nullptr, words.data(), environ);
  ::posix_spawn_file_actions_destroy(&actions);
  return error;
}

}  // namespace

expected<std::shared_ptr<DriverProcess>, SetupError> DriverProcess::start(
    const std::vector<std::string>& command) {
  std::shared_ptr<DriverProcess> made(new DriverProcess());
  auto control = make_sockets();
  auto calibration = make_sockets();
  const Handle memory = lifted(Handle(::memfd_create("rtpm-driver", MFD_CLOEXEC)));
  if (!control || !calibration || !memory.is_open()) return not_started("no descriptor is left");
  if (::ftruncate(memory.number(), sizeof(CycleMemory)) != 0) return not_started("no memory");
  void* const mapped = ::mmap(nullptr, sizeof(CycleMemory), PROT_READ | PROT_WRITE,
                              MAP_SHARED | MAP_POPULATE, memory.number(), 0);
  if (mapped == MAP_FAILED) return not_started("no memory");
  made->memory_ = new (mapped) CycleMemory();
  if (const int error = spawn(command, control->others, calibration->others, memory, made->number_);
      error != 0) {
    made->number_ = -1;
    errno = error;
    return not_started(command.front());
  }
  made->control_ = std::move(control->own);
  made->calibration_ = std::move(calibration->own);
  made->ending_ = Handle(static_cast<int>(::syscall(SYS_pidfd_open, made->number_, 0)));
  if (!made->ending_.is_open()) return not_started("no descriptor is left");
  return made;
}

DriverProcess::~DriverProcess() {
  control_.reset();
  calibration_.reset();
  if (number_ > 0 && !status_) {
    if (ending_.is_open() && wait_for_end(kEndPatience)) {
      reap();
    } else {
      kill();
    }
  }
  if (memory_ != nullptr) ::munmap(memory_, sizeof(CycleMemory));
}

std::optional<Frame> DriverProcess::receive_facts(MonotonicTime deadline) {
  return receive_frame(control_, deadline);
}

std::optional<Frame> DriverProcess::call(FrameKind kind, ConstBytes bytes, MonotonicTime deadline) {
  // The driver's thread reads the socket only after the doorbell, because a call may exceed the
  // socket's buffer.
  memory_->call_count.fetch_add(1, std::memory_order_release);
  memory_->has_request.ring();
  if (!send_frame(control_, kind, bytes, deadline)) return std::nullopt;
  return receive_frame(control_, deadline);
}

std::optional<Frame> DriverProcess::call_calibration(FrameKind kind, ConstBytes bytes,
                                                     MonotonicTime deadline) {
  const std::lock_guard lock(calibration_mutex_);
  if (!send_frame(calibration_, kind, bytes, deadline)) return std::nullopt;
  return receive_frame(calibration_, deadline);
}

bool DriverProcess::wait_for_end(Duration patience) const noexcept {
  if (status_) return true;
  const timespec timeout = rt::to_timespec(patience);
  pollfd waited{ending_.number(), POLLIN, 0};
  return ::ppoll(&waited, 1, &timeout, nullptr) > 0;
}

void DriverProcess::kill() noexcept {
  if (status_) return;
  ::kill(number_, SIGKILL);
  static_cast<void>(wait_for_end(kEndPatience));
  reap();
}

/// A process stuck in the kernel stays a zombie: no call waits for it unboundedly.
void DriverProcess::reap() noexcept {
  int status = 0;
  status_ = ::waitpid(number_, &status, WNOHANG) == number_ ? status : SIGKILL;
}

std::string DriverProcess::end_text() {
  if (!status_) reap();
  if (WIFSIGNALED(*status_)) {
    const int signal = WTERMSIG(*status_);
    return "signal " + std::to_string(signal) + " (" + ::sigdescr_np(signal) + ")";
  }
  return "exit code " + std::to_string(WEXITSTATUS(*status_));
}

}  // namespace rtpm::driver_host
