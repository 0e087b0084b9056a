#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/driver/descriptor.hpp"
#include "rtpm/gvd/device.hpp"
#include "rtpm/gvd/emergency.hpp"
#include "rtpm/gvd/server.hpp"
#include "rtpm/gvd/system_stop.hpp"

namespace rtpm::gvd {

/// Configures a StopKeeper.
struct StopKeeperConfig {
  /// The folder for the stops, one file per device. If empty, stops are forgotten when the program
  /// ends.
  std::string folder{};
  DeviceListener* listener = nullptr;  ///< May be null; must outlive the keeper.
};

/// Keeps the emergency stops of a program's devices on disk until they are rearmed: a stop belongs
/// to the device, by model and serial number, not to its server. A stop takes effect at once, and a
/// time-shared thread then writes it. A file that can't be written is reported and retried every
/// second. A file that can't be read counts as a stop.
/// @ownership refers to the devices' servers until stop()
/// @threads  add(), attach(), start() and stop() from one; the rest from any
class StopKeeper final : public SystemStopDevices {
 public:
  explicit StopKeeper(StopKeeperConfig config);
  StopKeeper(const StopKeeper&) = delete;
  StopKeeper& operator=(const StopKeeper&) = delete;
  ~StopKeeper() override;

  /// Reads the device's stored stop. Use the result as CycleConfig::stop_memory; unless attach()
  /// follows, it lives until the next add().
  /// @realtime set-up only
  [[nodiscard]] StopMemory& add(std::string_view name, const driver::Descriptor& descriptor);
  /// Attaches `device`, the server of the device that was added last.
  void attach(DeviceServer& device) noexcept;
  /// Starts the writing thread. Call before the rpc::Server starts.
  /// @realtime set-up only
  /// @errors   no thread left
  [[nodiscard]] expected<void, SetupError> start();
  /// Writes the remaining changes, and ends the thread. Call after the rpc::Server has stopped,
  /// before the devices are destroyed. May be called again.
  void stop() noexcept;

  /// Stops every device.
  /// @realtime alloc-free
  void stop_devices() noexcept;
  bool obey(std::uint64_t id) noexcept override;
  [[nodiscard]] std::uint64_t obeyed() const noexcept override;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtpm::gvd
