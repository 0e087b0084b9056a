#pragma once

#include <cstdint>

namespace rtpm::gvd {

/// Which devices an emergency stop affects; wire numbers.
enum class StopScope : std::uint8_t {
  kDevice = 0,  ///< The device.
  kServer = 1,  ///< All devices of its server's program.
  kSystem = 2,  ///< All devices of all servers at the same event hub.
};

/// The emergency stops of a program that hosts several devices.
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
  /// Stops them and requests the same from every other program, see SystemStop. False if this
  /// program does not take part in that, and so stopped only its own devices.
  [[nodiscard]] virtual bool stop_system() noexcept = 0;
};

/// Remembers a device's emergency stop beyond its server's life.
/// @threads  any
/// @realtime alloc-free
class StopMemory {
 public:
  StopMemory() = default;
  StopMemory(const StopMemory&) = delete;
  StopMemory& operator=(const StopMemory&) = delete;
  virtual ~StopMemory() = default;
  /// Whether the device was stopped when its last server ended: then it starts stopped.
  [[nodiscard]] virtual bool was_stopped() const noexcept = 0;
  /// Records that the device was stopped or rearmed, which is already in effect;
  /// DeviceServer::is_stopped() tells which. Does not wait for a disk.
  virtual void on_change() noexcept = 0;
};

}  // namespace rtpm::gvd
