#include <fcntl.h>
#include <pthread.h>
#include <sys/mman.h>

#include <atomic>
#include <csignal>
#include <cstdlib>
#include <map>
#include <mutex>
#include <utility>

#include "archive.hpp"
#include "isolation.hpp"
#include "rtpm/driver_host/isolated.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/pi_mutex.hpp"
#include "rtpm/rt/semaphore.hpp"

namespace rtpm::driver_host {
namespace {

using driver::Calibration;
using driver::ExchangeStatus;

constexpr Duration kFramePatience = std::chrono::seconds{1};
constexpr Duration kLoopEndPatience = std::chrono::seconds{1};
constexpr int kExitFailed = 1;
constexpr int kExitDriverBlocks = 3;

/// The running calibrations, by number, from 1.
/// @threads  any
class Calibrations {
 public:
  [[nodiscard]] std::uint64_t add(std::unique_ptr<Calibration> calibration) {
    if (calibration == nullptr) return 0;
    const std::lock_guard lock(mutex_);
    running_.emplace(++newest_, std::move(calibration));
    return newest_;
  }
  [[nodiscard]] std::shared_ptr<Calibration> find(std::uint64_t id) {
    const std::lock_guard lock(mutex_);
    const auto found = running_.find(id);
    return found == running_.end() ? nullptr : found->second;
  }
  void remove(std::uint64_t id) {
    const auto removed = find(id);
    const std::lock_guard lock(mutex_);
    running_.erase(id);
  }

 private:
  rt::PiMutex mutex_{};
  std::map<std::uint64_t, std::shared_ptr<Calibration>> running_{};
  std::uint64_t newest_ = 0;
};

/// The thread that calls the driver.
class DriverLoop {
 public:
  DriverLoop(driver::Driver& driver, CycleMemory& memory, const Handle& control,
             Calibrations& calibrations)
      : driver_(driver), memory_(memory), control_(control), calibrations_(calibrations) {}

  void run() {
    while (!is_ending_.load(std::memory_order_acquire)) {
      static_cast<void>(memory_.has_request.wait_until(off_at_));
      if (is_ending_.load(std::memory_order_acquire)) break;
      const std::uint64_t call_count = memory_.call_count.load(std::memory_order_acquire);
      if (call_count != handled_call_count_) {
        ++handled_call_count_;
        if (!handle_call()) break;
      }
      const auto request = memory_.requests.read();
      if (request && request->number > handled_request_) {
        exchange(*request);
      } else if (rt::now() >= off_at_) {
        switch_off();
      }
    }
    driver_.deactivate();
    has_ended_.post();
  }
  /// Makes the loop deactivate the device and end; false if the driver does not return.
  [[nodiscard]] bool end() {
    is_ending_.store(true, std::memory_order_release);
    memory_.has_request.ring();
    return has_ended_.wait_until(rt::now() + kLoopEndPatience);
  }

 private:
  void exchange(const CycleRequest& request) {
    handled_request_ = request.number;
    command_ = request.command;
    off_at_ = is_active_ ? request.command.deadline : kNever;
    if (std::exchange(is_first_, false)) sample_ = request.sample;
    const ExchangeStatus status = exchange_command();
    memory_.replies.write({request.number, static_cast<std::uint8_t>(status), sample_});
    memory_.has_reply.ring();
  }
  ExchangeStatus exchange_command() {
    sample_.faults = {};
    // The driver writes to a copy, so that a failed exchange changes nothing.
    driver::Sample taken = sample_;
    const ExchangeStatus status = driver_.exchange(command_, taken);
    if (status == ExchangeStatus::kOk) sample_ = taken;
    return status;
  }
  /// The other process is late or has stopped: no force until it is back.
  void switch_off() {
    const MonotonicTime now = rt::now();
    static_cast<driver::Setpoint&>(command_) = {};
    command_.cycle_time = now;
    command_.deadline = kNever;
    off_at_ = exchange_command() == ExchangeStatus::kGone ? kNever : now + period_;
  }

  [[nodiscard]] bool answer(FrameKind kind, const Writer& write) {
    return send_frame(control_, kind, write.bytes(), rt::now() + kFramePatience);
  }
  template <class Result>
  [[nodiscard]] bool answer(const Result& result) {
    Writer write;
    if (result) return answer(FrameKind::kDone, write);
    write(result.error());
    return answer(FrameKind::kFailed, write);
  }

  /// Handles one call; false if the other process is gone, or sent a malformed frame.
  [[nodiscard]] bool handle_call() {
    const auto frame = receive_frame(control_, rt::now() + kFramePatience);
    if (!frame) return false;
    Reader read(frame->bytes);
    switch (frame->kind) {
      case FrameKind::kConfigure:
        read(period_);
        return read.is_whole() && answer(driver_.configure({.period = period_}));
      case FrameKind::kActivate:
        return activate();
      case FrameKind::kDeactivate:
        driver_.deactivate();
        is_active_ = false;
        off_at_ = kNever;
        return answer(FrameKind::kDone, {});
      case FrameKind::kSetParameters:
        return set_parameters(read);
      case FrameKind::kMakeCalibration: {
        std::string name;
        read(name);
        Writer write;
        write(calibrations_.add(driver_.make_calibration(name)));
        return read.is_whole() && answer(FrameKind::kDone, write);
      }
      default:
        return false;
    }
  }
  [[nodiscard]] bool activate() {
    const auto activated = driver_.activate();
    is_active_ = activated.has_value();
    is_first_ = true;
    // Skips requests of a previous session.
    if (const auto request = memory_.requests.read()) handled_request_ = request->number;
    return answer(activated);
  }
  [[nodiscard]] bool set_parameters(Reader& read) {
    std::vector<driver::ParameterSetting> settings;
    read(settings);
    if (!read.is_whole()) return false;
    if (const auto set = driver_.set_parameters(settings); !set) return answer(set);
    Writer write;
    write(settings);
    return answer(FrameKind::kDone, write);
  }

  driver::Driver& driver_;
  CycleMemory& memory_;
  const Handle& control_;
  Calibrations& calibrations_;
  driver::Command command_{};  ///< The newest command.
  driver::Sample sample_{};
  Duration period_{};
  MonotonicTime off_at_ = kNever;  ///< When the force ends without a newer command.
  std::uint64_t handled_call_count_ = 0;
  std::uint64_t handled_request_ = 0;
  bool is_first_ = true;
  bool is_active_ = false;
  std::atomic<bool> is_ending_{false};
  rt::Semaphore has_ended_{};
};

/// Runs steps of calibrations until the other process ends this one, or itself.
void serve_calibrations(const Handle& socket, Calibrations& calibrations) {
  while (const auto frame = receive_frame(socket, kNever)) {
    Reader read(frame->bytes);
    std::uint64_t id = 0;
    read(id);
    Writer write;
    if (frame->kind == FrameKind::kRelease) {
      calibrations.remove(id);
    } else {
      driver::Sample sample;
      std::optional<std::string> answer;
      read(sample, answer);
      const auto calibration = calibrations.find(id);
      if (!read.is_whole() || calibration == nullptr) return;
      write(calibration->step(sample,
                              answer ? std::optional<std::string_view>(*answer) : std::nullopt));
    }
    if (!send_frame(socket, FrameKind::kDone, write.bytes(), rt::now() + kFramePatience)) return;
  }
}

int send_error(const Handle& control, const SetupError& error) {
  Writer write;
  write(error);
  static_cast<void>(
      send_frame(control, FrameKind::kFailed, write.bytes(), rt::now() + kFramePatience));
  return kExitFailed;
}

bool send_facts(const Handle& control, const driver::Driver& driver) {
  Writer write;
  write(driver.describe(), driver.parameters(), driver.calibrations());
  return send_frame(control, FrameKind::kFacts, write.bytes(), rt::now() + kFramePatience);
}

/// Blocks signals, so that this process ends with the one that started it, and not by a signal sent
/// to both.
void block_signals() {
  sigset_t signals;
  sigemptyset(&signals);
  for (const int signal : {SIGHUP, SIGINT, SIGQUIT, SIGTERM})
    sigaddset(&signals, signal);
  ::pthread_sigmask(SIG_BLOCK, &signals, nullptr);
}

}  // namespace

int serve_driver(expected<std::unique_ptr<driver::Driver>, SetupError> driver,
                 const rt::ThreadConfig& thread) {
  block_signals();
  const Handle control(kControlHandle);
  const Handle calibration(kCalibrationHandle);
  for (const int handle : {kControlHandle, kCalibrationHandle, kMemoryHandle})
    ::fcntl(handle, F_SETFD, FD_CLOEXEC);
  void* const mapped = ::mmap(nullptr, sizeof(CycleMemory), PROT_READ | PROT_WRITE,
                              MAP_SHARED | MAP_POPULATE, kMemoryHandle, 0);
  if (mapped == MAP_FAILED) return kExitFailed;
  auto& memory = *static_cast<CycleMemory*>(mapped);
  if (!driver) return send_error(control, driver.error());
  Calibrations calibrations;
  DriverLoop loop(**driver, memory, control, calibrations);
  auto started = rt::Thread::start(thread, [&loop] { loop.run(); });
  if (!started) return send_error(control, started.error());
  if (!send_facts(control, **driver)) return kExitFailed;
  serve_calibrations(calibration, calibrations);
  // If the driver does not return, nothing that it uses may be destroyed.
  if (!loop.end()) std::_Exit(kExitDriverBlocks);
  return 0;
}

}  // namespace rtpm::driver_host
