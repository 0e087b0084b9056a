#pragma once

#include <atomic>
#include <string>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/gvd/server.hpp"
#include "rtpm/rt/log.hpp"
#include "rtpm/rt/thread.hpp"

namespace rtpm::deviced {

/// Logs when a call of a driver blocks and when it returns, because the driver's own thread can't.
/// @ownership refers to the device servers, which must outlive it
/// @threads  set-up: one thread
class DriverWatch {
 public:
  /// A driver whose call takes longer counts as blocked.
  static constexpr Duration kBlockedMin = std::chrono::seconds{1};

  DriverWatch() = default;
  ~DriverWatch();
  DriverWatch(const DriverWatch&) = delete;
  DriverWatch& operator=(const DriverWatch&) = delete;

  /// Adds a device. Call before start().
  void add(std::string device, const gvd::DeviceServer& server) {
    devices_.push_back({std::move(device), &server, Duration{0}});
  }
  /// @errors   the thread can't be created
  [[nodiscard]] expected<void, SetupError> start();

 private:
  struct Device {
    std::string name{};
    const gvd::DeviceServer* server = nullptr;
    /// How long its driver had been blocked at the last check; 0 if it was not blocked.
    Duration blocked{};
  };
  void look_at(Device& device);

  std::vector<Device> devices_{};
  rt::Log log_{"rtpm-deviced"};
  std::atomic<bool> is_stopping_{false};
  rt::Thread thread_{};
};

}  // namespace rtpm::deviced
