#pragma once

#include <cstdint>

namespace rtpm::gvd {

/// What an emergency stop stops; wire numbers.
enum class StopScope : std::uint8_t {
  kDevice = 0,  ///< The device.
  kServer = 1,  ///< All devices of its server's program.
  kSystem = 2,  ///< All devices of all servers at the same hub of events.
};
inline constexpr std::uint8_t kStopScopeCount = 3;

/// The emergency stops of a program that hosts devices, beyond the one device.
/// @threads  any
/// @realtime alloc-free
class EmergencyStops {
 public:
  EmergencyStops() = default;
  EmergencyStops(const EmergencyStops&) = delete;
  EmergencyStops& operator=(const EmergencyStops&) = delete;
  virtual ~EmergencyStops() = default;
  /// Stops every device of this program.
  virtual void stop_devices() noexcept = 0;
  /// Stops them and requests the same of every other program, see SystemStop; false: it takes no
  /// part in that, and stopped only its own.
  [[nodiscard]] virtual bool stop_system() noexcept = 0;
};

}  // namespace rtpm::gvd
