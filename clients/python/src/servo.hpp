#pragma once

#include <atomic>
#include <cstdint>
#include <memory>

#include "forking.hpp"
#include "remote_device.hpp"
#include "rtpm/base/histogram.hpp"
#include "rtpm/base/latest.hpp"
#include "rtpm/base/priority.hpp"
#include "rtpm/models/model.hpp"
#include "rtpm/rt/thread.hpp"

namespace rtpm::python {

/// The figures of a loop.
/// @ownership plain value
struct LoopFigures {
  std::uint64_t cycle_count = 0;
  std::uint64_t late_count = 0;    ///< Cycles that began a whole period late; those are skipped.
  std::uint64_t failed_count = 0;  ///< Cycles whose read or command failed.
  std::uint64_t paused_count = 0;  ///< Cycles without a command, because Python was not seen.
  Duration worst{};                ///< The latest begin of a cycle.
};

/// Renders models on a thread of its own: each cycle reads the newest sample, evaluates the models
/// and commands their force. Python changes the models through a lock-free cell, and is never
/// waited for. While Python is not seen, the servo commands nothing, so that the device's hold ends
/// the force.
/// @ownership keeps its device
/// @threads   start and stop from one; set() from one; figures() from any
/// @realtime  its thread allocates nothing
class Servo {
 public:
  /// @errors those of rt::Thread::start()
  [[nodiscard]] static expected<std::unique_ptr<Servo>, SetupError> start(SharedDevice device,
                                                                          Duration period,
                                                                          Priority priority);
  Servo(const Servo&) = delete;
  Servo& operator=(const Servo&) = delete;
  ~Servo();

  /// Renders `models` from the next cycle on.
  void set(const gvd::ModelList& models) noexcept { models_.write(models); }
  void stop() noexcept;
  [[nodiscard]] const SharedDevice& device() const noexcept { return device_; }
  [[nodiscard]] Duration period() const noexcept { return period_; }
  [[nodiscard]] LoopFigures figures() const noexcept;
  /// Whether it still commands: it ends by itself when the lease is lost.
  [[nodiscard]] bool is_running() const noexcept {
    return is_running_.load(std::memory_order_acquire);
  }

 private:
  Servo(SharedDevice device, Duration period, Priority priority) noexcept
      : device_(std::move(device)), period_(period), priority_(priority) {}
  void run() noexcept;
  [[nodiscard]] bool cycle(class ServoState& state) noexcept;

  SharedDevice device_;
  Duration period_;
  Priority priority_;
  Latest<gvd::ModelList> models_{};
  Latest<LoopFigures> figures_{};
  std::atomic<bool> is_stopping_{false};
  std::atomic<bool> is_running_{true};
  Unforked<rt::Thread> thread_{};
};

}  // namespace rtpm::python
