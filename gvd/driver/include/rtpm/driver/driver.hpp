#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>

#include "rtpm/base/expected.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/driver/command.hpp"
#include "rtpm/driver/descriptor.hpp"
#include "rtpm/driver/sample.hpp"

namespace rtpm::driver {

/// Why a device could not be set up: one sentence that names it, the cause and the remedy.
struct DriverError {
  std::string text;
};

[[nodiscard]] inline unexpected<DriverError> driver_error(std::string text) {
  return unexpected<DriverError>{DriverError{std::move(text)}};
}

/// How one exchange with the device ended.
enum class ExchangeStatus : std::uint8_t {
  kOk,       ///< The sample is new and whole, the command was delivered.
  kLate,     ///< No new data within the cycle: the sample is as it was. Go on.
  kCorrupt,  ///< The data was unreadable and was dropped: the sample is as it was. Go on.
  kGone,  ///< The device does not answer any more: deactivate, then configure and activate again.
};
/// "ok", "late", "corrupt", "gone".
[[nodiscard]] std::string_view to_string(ExchangeStatus status) noexcept;

/// What the host tells a driver before it starts.
struct DriverConfig {
  /// How often exchange() will be called, more or less; each Command says when exactly.
  Duration period = std::chrono::milliseconds{1};
};

/// One device: what a driver author writes, and all that RTPM knows of the hardware. The paper
/// calls it the RT Data Access layer. It sees no network: the same driver runs under the device
/// server and in a local loop.
///
/// The order of calls, repeated as often as needed:
///
///     describe()   at any time
///     configure() → activate() → exchange() … exchange() → deactivate()
///
/// A failed configure() or activate() leaves the driver as before it. After deactivate() comes
/// configure() or the end.
/// @threads  one at a time; the device server calls everything from activate() on from one thread
class Driver {
 public:
  Driver() = default;
  Driver(const Driver&) = delete;
  Driver& operator=(const Driver&) = delete;
  /// Deactivates if need be.
  virtual ~Driver() = default;

  /// What the device is; the same answer every time, in every state.
  /// @realtime set-up only
  [[nodiscard]] virtual Descriptor describe() const = 0;

  /// Opens the device and gives it its settings; may take seconds, but gives up by
  /// itself. No force yet.
  /// @realtime set-up only
  /// @errors   not plugged in, no right to open it, wrong firmware: in words, with the remedy
  [[nodiscard]] virtual expected<void, DriverError> configure(const DriverConfig& config) = 0;

  /// Makes the device ready for exchange(); allocates all that exchange() will need.
  /// @realtime set-up only
  /// @errors   the device refuses: in words, with the remedy
  [[nodiscard]] virtual expected<void, DriverError> activate() = 0;

  /// Gives the device its command and takes its newest sample: the only real-time call, once per
  /// cycle. Waits for the hardware at most a fraction of the period. On entry `sample` holds the
  /// last cycle's values, so that counters can go on from there, and no faults. With kOk it holds
  /// every value that the device has and the driver's own fault bits; sequence, success_rate and
  /// lifecycle are the server's. With any other status it is as it was on entry.
  /// Whatever the command says, the driver applies no more than the descriptor's limits, and zero
  /// for a mode that it does not know.
  /// @realtime alloc-free, throws nothing, takes no lock that a time-shared thread may hold
  /// @errors   as ExchangeStatus says
  [[nodiscard]] virtual ExchangeStatus exchange(const Command& command,
                                                Sample& sample) noexcept = 0;

  /// Takes all force away and closes the device, also one that is gone. Does nothing if it is not
  /// active.
  /// @realtime set-up only
  virtual void deactivate() noexcept = 0;
};

}  // namespace rtpm::driver
