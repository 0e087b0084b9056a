#pragma once

#include <atomic>
#include <cstdint>
#include <optional>

#include "delay_line.hpp"
#include "feel.hpp"
#include "rtpm/base/histogram.hpp"
#include "rtpm/base/latest.hpp"
#include "rtpm/base/ring.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/driver/sample.hpp"
#include "rtpm/gvd/client.hpp"
#include "rtpm/gvd/error.hpp"
#include "rtpm/rt/thread.hpp"
#include "touch_event.hpp"
#include "wall.hpp"

namespace rtpm::servo {

/// The paper's best case: the latency of most of its calls on one node.
inline constexpr Duration kPaperCall = std::chrono::microseconds{58};
/// The paper's specification of a haptic process: 1 kHz.
inline constexpr Duration kPaperCycle = std::chrono::milliseconds{1};

/// Results of a run. Failed calls are counted but not in the histograms: a call refused immediately
/// is not a fast call.
struct Statistics {
  LatencyHistogram read{};  ///< One call, until its reply.
  LatencyHistogram command{};
  /// Both calls and the wall computation between them; for a local wall, one call.
  LatencyHistogram cycle{};
  LatencyHistogram lateness{};      ///< Time from a cycle's due time to its start.
  std::uint64_t cycle_count = 0;    ///< Cycles started.
  std::uint64_t missed_count = 0;   ///< Cycles that ended after the next was due, or were skipped.
  std::uint64_t contact_count = 0;  ///< Cycles inside the wall.
  std::uint64_t call_count = 0;     ///< Calls started.
  std::uint64_t failed_count = 0;   ///< Calls that failed.
  std::uint64_t call_within_paper_count = 0;   ///< Calls that succeeded within kPaperCall.
  std::uint64_t cycle_within_paper_count = 0;  ///< Cycles that succeeded within kPaperCycle.
  /// The largest commanded force; with a local wall, the largest applied force.
  double force_newton_max = 0;
  Feel feel{};
};

/// The loop's current state, for display.
struct Live {
  driver::Sample sample{};
  driver::Vector3 force_newton{};
  double depth_m = 0;
  std::uint64_t cycle_count = 0;
  std::uint64_t failed_count = 0;
};

/// Settings of the loop.
struct LoopConfig {
  Wall wall{};
  bool is_local = false;  ///< The device renders the wall; the loop only observes.
  Duration delay{0};      ///< Artificial delay of each sample and each command.
  Duration period = std::chrono::milliseconds{1};
  Duration duration{0};               ///< 0 to run until stop().
  std::uint64_t cycle_count_max = 0;  ///< 0 for no limit.
  Duration deadline = std::chrono::milliseconds{10};
  Duration patience = std::chrono::seconds{1};
  rt::ThreadConfig thread{.name = "servo"};
};

/// The paper's §3.1: reads the device's position, computes the force of a virtual wall and sends
/// it, at a steady rate, on its own thread, which prints nothing. About 350 KiB; do not put it on a
/// stack.
/// @ownership refers to the device, which must outlive it
/// @threads  start(), join(), statistics(): one; live(), next_cycle(): another; stop(): any
/// @realtime the loop's thread is alloc-free
class Loop {
 public:
  Loop(gvd::DeviceClient& device, const LoopConfig& config) noexcept
      : device_(device), config_(config), proxy_(config.wall.proxy()), link_(2 * config.delay) {}

  /// @realtime set-up only
  /// @errors   with RealtimeMode::kRequire, the process lacks a right
  [[nodiscard]] expected<void, SetupError> start();
  /// Ends the loop after its current cycle; alloc-free.
  void stop() noexcept { is_stopping_.store(true, std::memory_order_relaxed); }
  /// Waits until the loop has ended.
  void join() noexcept { thread_.join(); }
  [[nodiscard]] bool is_running() const noexcept {
    return !is_over_.load(std::memory_order_acquire);
  }

  [[nodiscard]] std::optional<Live> live() const noexcept { return live_.read(); }
  /// The latency of the next unread cycle.
  [[nodiscard]] std::optional<Duration> next_cycle() noexcept { return cycles_.pop(); }
  /// The next unread touch. If 1024 are unread, newer ones are lost.
  [[nodiscard]] std::optional<scene::TouchReport> next_touch() noexcept { return touches_.pop(); }

  /// Changes stiffness and damping between two cycles.
  /// @return  false if 4 changes are queued, or the loop has ended
  /// @threads one
  [[nodiscard]] bool change(scene::Material material) noexcept {
    return is_running() && materials_.push(material);
  }
  /// How many changes the loop has applied.
  /// @threads any
  [[nodiscard]] std::uint64_t change_count() const noexcept {
    // SYNC POINT material-changed
    return change_count_.load(std::memory_order_acquire);
  }

  /// The results; call it after join().
  [[nodiscard]] const Statistics& statistics() const noexcept { return statistics_; }
  /// The error that ended the loop early, if any; call it after join().
  [[nodiscard]] std::optional<gvd::DeviceError> loss() const noexcept { return loss_; }

 private:
  void run() noexcept;
  void run_cycle(MonotonicTime due) noexcept;
  void take_changes() noexcept;
  [[nodiscard]] expected<driver::Vector3, gvd::DeviceError> render(const driver::Sample& sample,
                                                                   const scene::Touch& touch,
                                                                   MonotonicTime now) noexcept;
  void publish(const driver::Sample& sample, scene::Touch touch,
               const driver::Vector3& force_newton) noexcept;
  void record_call(LatencyHistogram& histogram, Duration latency) noexcept;
  void fail(gvd::DeviceError error, MonotonicTime now) noexcept;

  Latest<Live> live_{};
  SpscRing<Duration, 8192> cycles_{};
  SpscRing<scene::TouchReport, 1024> touches_{};
  SpscRing<scene::Material, 4> materials_{};
  std::atomic<std::uint64_t> change_count_{0};
  gvd::DeviceClient& device_;
  LoopConfig config_;
  rpc::CallOptions call_{};
  scene::GodObject proxy_;
  /// Each force depends only on samples up to its own, so one delay line has the same effect as
  /// delaying sample and command separately.
  DelayLine<driver::Vector3, 2048> link_;
  Statistics statistics_{};
  Live view_{};
  std::optional<MonotonicTime> failing_since_{};
  std::optional<gvd::DeviceError> loss_{};
  std::atomic<bool> is_stopping_{false};
  std::atomic<bool> is_over_{false};
  rt::Thread thread_{};
};

}  // namespace rtpm::servo
