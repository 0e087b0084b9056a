#pragma once

#include <semaphore.h>

#include <atomic>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/latest.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/driver/driver.hpp"

/// Shared by both processes of an isolated driver: memory for cycles, sockets for everything else.
namespace rtpm::driver_host {

/// Owns a file descriptor.
class Handle {
 public:
  explicit Handle(int number = -1) noexcept : number_(number) {}
  Handle(Handle&& other) noexcept : number_(std::exchange(other.number_, -1)) {}
  Handle& operator=(Handle&& other) noexcept {
    reset();
    number_ = std::exchange(other.number_, -1);
    return *this;
  }
  ~Handle() { reset(); }
  void reset() noexcept;
  [[nodiscard]] int number() const noexcept { return number_; }
  [[nodiscard]] bool is_open() const noexcept { return number_ >= 0; }

 private:
  int number_;
};

// The descriptor numbers in the driver's process.
inline constexpr int kControlHandle = 3;  ///< Carries calls from the thread that calls the driver.
inline constexpr int kCalibrationHandle = 4;  ///< Carries calls of calibrations, from any thread.
inline constexpr int kMemoryHandle = 5;       ///< CycleMemory.

/// A counter that threads of both processes increment and wait for.
/// @threads  any, of both processes
/// @realtime alloc-free; at most one system call each
class SharedDoorbell {
 public:
  SharedDoorbell() noexcept { sem_init(&semaphore_, /*pshared=*/1, 0); }
  void ring() noexcept { static_cast<void>(sem_post(&semaphore_)); }
  /// False if it was not rung by `deadline`.
  [[nodiscard]] bool wait_until(MonotonicTime deadline) noexcept;

 private:
  sem_t semaphore_;
};

/// @ownership plain value
struct CycleRequest {
  std::uint64_t number = 0;
  driver::Command command{};
  driver::Sample sample{};  ///< The input of the first exchange() after activate().
};
/// @ownership plain value
struct CycleReply {
  std::uint64_t number = 0;  ///< The request's number.
  std::uint8_t status = 0;   ///< An ExchangeStatus.
  driver::Sample sample{};   ///< Valid with kOk.
};

/// Memory shared by both processes. Each side treats the other's data as hostile: copies it, then
/// checks it.
struct CycleMemory {
  Latest<CycleRequest> requests{};
  Latest<CycleReply> replies{};
  std::atomic<std::uint64_t> call_count{0};  ///< Calls sent to kControlHandle.
  SharedDoorbell has_request{};              ///< Rung for a request or a call.
  SharedDoorbell has_reply{};
};

/// The kind of a frame: a call, or an answer to one.
enum class FrameKind : std::uint8_t {
  kFacts,  ///< Unasked, at the start: SetupError, or descriptor, parameters and calibrations.
  kConfigure,
  kActivate,
  kDeactivate,
  kSetParameters,
  kMakeCalibration,
  kStep,
  kRelease,
  kDone,    ///< The call's result.
  kFailed,  ///< A SetupError.
};

/// @ownership a value
struct Frame {
  FrameKind kind{};
  std::vector<std::byte> bytes{};
};

/// Sends a frame; false if the other end is gone, or did not accept it by `deadline`.
/// @realtime set-up only
[[nodiscard]] bool send_frame(const Handle& socket, FrameKind kind, ConstBytes bytes,
                              MonotonicTime deadline);
/// Receives a frame; nullopt if the other end is gone, sent none by `deadline`, or sent one above 4
/// MiB.
/// @realtime set-up only
[[nodiscard]] std::optional<Frame> receive_frame(const Handle& socket, MonotonicTime deadline);

}  // namespace rtpm::driver_host
