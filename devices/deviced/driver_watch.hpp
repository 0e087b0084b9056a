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

/// Logs when a driver does not return, and when it has returned: the driver's own thread can't.
/// @ownership refers to the devices' servers, which must outlive it
/// @threads  set-up from one
class DriverWatch {
 public:
  /// Time without a return after which a driver counts as blocked.
  static constexpr Duration kBlockedMin = std::chrono::seconds{1};

  DriverWatch() = default;
  ~DriverWatch();
  DriverWatch(const DriverWatch&) = delete;
  DriverWatch& operator=(const DriverWatch&) = delete;

  /// Adds a device. Call before start().
  void add(std::string device, const gvd::DeviceServer& server) {
    devices_.push_back({std::move(device), &server, Duration{0}});
  }
  /// @errors   no thread left
  [[nodiscard]] expected<void, SetupError> start();

 private:
  struct Device {
    std::string name{};
    const gvd::DeviceServer* server = nullptr;
    Duration blocked{};  ///< How long its driver was last seen blocked; 0 if not.
  };
  void look_at(Device& device);

  std::vector<Device> devices_{};
  rt::Log log_{"rtpm-deviced"};
  std::atomic<bool> is_stopping_{false};
  rt::Thread thread_{};
};

}  // namespace rtpm::deviced
