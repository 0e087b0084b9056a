#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "rtpm/base/time.hpp"
#include "rtpm/driver/command.hpp"
#include "rtpm/driver/geometry.hpp"
#include "rtpm/driver/sample.hpp"

namespace rtpm::gvd {

/// One cycle of a device: the measured, requested and applied values, and the decisions of the
/// safety filter's mechanisms.
/// @ownership plain value, trivially copyable
struct FlightRecord {
  std::uint64_t cycle = 0;
  MonotonicTime time{};
  driver::Vector3 position_m{};
  driver::Vector3 velocity_m_per_s{};
  driver::Wrench received{};  ///< The command with its models; zero if there is none.
  driver::Wrench applied{};   ///< The wrench passed to the driver.
  driver::Faults faults{};    ///< The mechanisms that acted, one bit each.
  bool has_command = false;
  double gain = 0;          ///< The factor of soft start and watchdog.
  double energy_joule = 0;  ///< The lowest energy of the passivity guard's axes.
  double heat = 0;          ///< 0 is cold; at 1 the heat limit is fully in force.
};
static_assert(std::is_trivially_copyable_v<FlightRecord>);

/// The fault that froze a flight record; wire numbers.
enum class FlightCause : std::uint8_t {
  kNone = 0,
  kCommandNotFinite = 1,
  kTooFast = 2,
  kEmergencyStop = 3,
  kDeviceGone = 4,
};
/// "none", "command not finite", "too fast", "emergency stop", "device gone".
[[nodiscard]] std::string_view to_string(FlightCause cause) noexcept;

/// The last cycles around a fault.
struct FlightLog {
  std::uint64_t number = 0;  ///< Counts a device's faults from 1; 0 if there was none.
  FlightCause cause = FlightCause::kNone;
  std::uint64_t cycle = 0;              ///< The fault's cycle.
  std::size_t record_count = 0;         ///< Records in the whole log.
  std::vector<FlightRecord> records{};  ///< Oldest first; possibly a part of the log.
  /// The clock of the records' times minus this host's clock; 0 unless the device is on another
  /// host.
  Duration clock_offset{0};
};

/// One line per cycle, after two header lines with the cause, the cycle and the columns.
/// @realtime set-up only
[[nodiscard]] std::string to_csv(const FlightLog& log);

/// A ring of the last cycles, frozen kAfterCount cycles after each fault. The newest frozen one
/// stays readable until the next.
/// @ownership two rings of kCycleCount records, below 2 MiB together
/// @threads  record() from one; newest(), number() from any
/// @realtime record() is alloc-free and never waits: while a reader copies, it freezes a later
///           cycle. newest() is set-up only; its thread's priority is below the writer's
/// @source   libfranka's log of the last states and commands in its ControlException
class FlightRecorder {
 public:
  static constexpr std::size_t kCycleCount = 4096;
  static constexpr std::size_t kAfterCount = 256;

  FlightRecorder() : rings_{Ring(kCycleCount), Ring(kCycleCount)} {}

  /// Adds a cycle. A newly set latching fault starts a flight log.
  void record(const FlightRecord& record) noexcept;
  /// The number of the newest frozen log; 0 if there is none.
  [[nodiscard]] std::uint64_t number() const noexcept {
    return number_.load(std::memory_order_acquire);
  }
  /// The newest frozen log.
  /// @param first, count  range of its records, oldest first
  [[nodiscard]] FlightLog newest(std::size_t first = 0, std::size_t count = kCycleCount) const;

 private:
  using Ring = std::vector<FlightRecord>;

  void freeze() noexcept;

  std::array<Ring, 2> rings_;
  std::uint64_t count_ = 0;  ///< Records in the ring that is being written.
  std::size_t writing_ = 0;  ///< The ring that is being written.
  driver::Faults last_faults_{};
  FlightCause pending_cause_ = FlightCause::kNone;
  std::uint64_t pending_cycle_ = 0;
  std::size_t cycles_left_ = 0;

  // The state of the frozen log; written only while is_swapping_.
  FlightCause cause_ = FlightCause::kNone;
  std::uint64_t cycle_ = 0;
  std::uint64_t frozen_count_ = 0;
  std::atomic<std::uint64_t> number_{0};
  std::atomic<bool> is_swapping_{false};
  mutable std::atomic<std::uint32_t> reader_count_{0};
};

}  // namespace rtpm::gvd
