#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/driver/calibration.hpp"
#include "rtpm/driver/command.hpp"
#include "rtpm/driver/descriptor.hpp"
#include "rtpm/driver/parameter.hpp"
#include "rtpm/driver/sample.hpp"

namespace rtpm::driver {

/// Result of exchange().
enum class ExchangeStatus : std::uint8_t {
  kOk,       ///< The sample is new and complete, the command delivered.
  kLate,     ///< No new data in this cycle; the sample is unchanged.
  kCorrupt,  ///< Unreadable data was dropped; the sample is unchanged.
  kGone,     ///< No answer: deactivate, then configure and activate again.
};
/// "ok", "late", "corrupt", "gone".
[[nodiscard]] std::string_view to_string(ExchangeStatus status) noexcept;

/// Settings for configure().
struct DriverConfig {
  /// Nominal period of exchange(); Command::cycle_time is exact.
  Duration period = std::chrono::milliseconds{1};
};

/// A device's driver: the paper's RT Data Access layer. It has no network access: the same driver
/// runs in the device server and in a local loop.
///
/// The order of calls, repeated as often as needed:
///
///     describe()   at any time
///     configure() → activate() → exchange() … exchange() → deactivate()
///     parameters(), set_parameters(), calibrations(), make_calibration()   between any of these
///
/// A failed configure() or activate() leaves the driver as it was before. After deactivate(), only
/// configure() or destruction may follow.
/// @threads  one at a time; from activate() on, the device server uses a single thread
class Driver {
 public:
  Driver() = default;
  Driver(const Driver&) = delete;
  Driver& operator=(const Driver&) = delete;
  /// Deactivates if necessary.
  virtual ~Driver() = default;

  /// The device's descriptor: constant, available in every state.
  /// @realtime set-up only
  [[nodiscard]] virtual Descriptor describe() const = 0;

  /// Opens and configures the device; applies no force yet. May take seconds, but must return.
  /// @realtime set-up only
  /// @errors   described in words with the remedy: not plugged in, no permission, wrong firmware
  [[nodiscard]] virtual expected<void, SetupError> configure(const DriverConfig& config) = 0;

  /// Prepares exchange(), including all allocations.
  /// @realtime set-up only
  /// @errors   described in words with the remedy
  [[nodiscard]] virtual expected<void, SetupError> activate() = 0;

  /// Sends the device its command and receives its newest sample: the only real-time call, once per
  /// cycle. Waits for the hardware at most a fraction of the period. On entry `sample` holds the
  /// last cycle's values, so that counters can continue, and no faults. With kOk the driver has
  /// filled in every value that the device has, and its own fault bits; the server sets sequence,
  /// success_rate and lifecycle. With any other status the sample must be unchanged. Whatever the
  /// command contains, the driver applies no more than the descriptor's limits, and zero for a mode
  /// that it does not know.
  /// @realtime alloc-free, throws nothing, takes no lock that a time-shared thread may hold
  /// @errors   see ExchangeStatus
  [[nodiscard]] virtual ExchangeStatus exchange(const Command& command,
                                                Sample& sample) noexcept = 0;

  /// Sets the force to zero and closes the device, even if the device is gone. No effect if not
  /// active.
  /// @realtime set-up only
  virtual void deactivate() noexcept = 0;

  /// The device's parameters: constant, available in every state. By default none.
  /// @realtime set-up only
  [[nodiscard]] virtual std::vector<ParameterSpec> parameters() const { return {}; }

  /// Changes all of `settings` or none. Each setting is one of parameters(), occurs once, has the
  /// right type and range, and may change in the current state; check only conditions between
  /// several. On success `settings` holds the values that the device took over, such as rounded to
  /// its steps. May be called in any state, between two exchange(). The driver keeps the values
  /// across deactivate() and configure(), and while the device is gone.
  /// @realtime set-up only; must end within a few milliseconds, because exchange() waits meanwhile
  /// @errors   described in words with the remedy; nothing has changed
  [[nodiscard]] virtual expected<void, SetupError> set_parameters(
      std::span<ParameterSetting> settings);

  /// The device's calibrations, constant. By default none.
  /// @realtime set-up only
  [[nodiscard]] virtual std::vector<CalibrationInfo> calibrations() const { return {}; }

  /// Creates a run of the calibration `name`, based on the current parameter values; null if there
  /// is no such calibration. Called between two exchange().
  /// @realtime set-up only
  [[nodiscard]] virtual std::unique_ptr<Calibration> make_calibration(std::string_view name);
};

}  // namespace rtpm::driver
