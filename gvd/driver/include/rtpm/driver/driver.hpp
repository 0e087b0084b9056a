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

/// A device's driver: the paper's RT Data Access layer. It sees no network: the same driver runs in
/// the device server and in a local loop.
///
/// The order of calls, repeated as often as needed:
///
///     describe()   at any time
///     configure() → activate() → exchange() … exchange() → deactivate()
///     parameters(), set_parameters(), calibrations(), make_calibration()   between any of these
///
/// A failed configure() or activate() leaves the driver as before it. After deactivate() comes
/// configure() or the end.
/// @threads  one at a time; the device server calls from activate() on from one thread
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

  /// Opens and configures the device; no force yet. May take seconds, but must end by itself.
  /// @realtime set-up only
  /// @errors   in words with the remedy: not plugged in, no permission, wrong firmware
  [[nodiscard]] virtual expected<void, SetupError> configure(const DriverConfig& config) = 0;

  /// Prepares exchange(), including all allocations.
  /// @realtime set-up only
  /// @errors   in words with the remedy
  [[nodiscard]] virtual expected<void, SetupError> activate() = 0;

  /// Gives the device its command and takes its newest sample: the only real-time call, once per
  /// cycle. Waits for the hardware at most a fraction of the period. On entry `sample` holds the
  /// last cycle's values, so that counters can go on from there, and no faults. With kOk it holds
  /// every value that the device has and the driver's own fault bits; the server sets sequence,
  /// success_rate and lifecycle. With any other status it is unchanged.
  /// Whatever the command contains, the driver applies no more than the descriptor's limits, and
  /// zero for a mode that it does not know.
  /// @realtime alloc-free, throws nothing, takes no lock that a time-shared thread may hold
  /// @errors   as ExchangeStatus says
  [[nodiscard]] virtual ExchangeStatus exchange(const Command& command,
                                                Sample& sample) noexcept = 0;

  /// Sets the force to zero and closes the device, even one that is gone. No effect if not active.
  /// @realtime set-up only
  virtual void deactivate() noexcept = 0;

  /// The device's parameters: constant, available in every state. By default none.
  /// @realtime set-up only
  [[nodiscard]] virtual std::vector<ParameterSpec> parameters() const { return {}; }

  /// Changes parameters, all of `settings` or none. Each is one of parameters(), at most once, of
  /// its type, within its range, and mutable in the present state; check what depends on several.
  /// On success `settings` holds the values as the device has taken them, such as rounded to its
  /// steps. Called in any state, between two exchange(). The driver keeps the values across
  /// deactivate() and configure(), and for as long as the device is gone.
  /// @realtime set-up only; ends within a few milliseconds, because exchange() waits meanwhile
  /// @errors   in words with the remedy; nothing has changed
  [[nodiscard]] virtual expected<void, SetupError> set_parameters(
      std::span<ParameterSetting> settings);

  /// The device's calibrations, constant. By default none.
  /// @realtime set-up only
  [[nodiscard]] virtual std::vector<CalibrationInfo> calibrations() const { return {}; }

  /// Makes a run of the calibration `name`, based on the present values of the parameters; null if
  /// there is no such calibration. Called between two exchange().
  /// @realtime set-up only
  [[nodiscard]] virtual std::unique_ptr<Calibration> make_calibration(std::string_view name);
};

}  // namespace rtpm::driver
