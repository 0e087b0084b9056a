#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "live/callbacks.hpp"
#include "operators/device_link.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/gvd/error.hpp"
#include "services/call_router.hpp"
#include "work/worker_pool.hpp"

namespace rtpm::console {

/// The commands of operators: the leases that the console holds for browsers, and which connection
/// operates each device.
/// @ownership refers to all its arguments
/// @threads  the web server's thread
class OperatorDesk {
 public:
  /// How long a browser that operates a device may be absent.
  static constexpr Duration kGoneMax = std::chrono::seconds{5};

  /// Access to the devices.
  struct Devices {
    std::function<std::vector<std::string>()> names{};
    /// Returns null if the device does not exist or has not been bound yet.
    std::function<std::shared_ptr<DeviceLink>(const std::string&)> link{};
  };

  OperatorDesk(CallRouter& router, WorkerPool& pool, Post post, Devices devices);

  /// Adds the services.
  void start();
  /// Why a connection may not command a device now; empty if it may.
  [[nodiscard]] std::string refusal(std::uint64_t connection_id, const std::string& device,
                                    bool is_forced) const;
  /// Renews the leases, removes those that have ended, and releases those whose browser has been
  /// absent for kGoneMax. Call it a few times per second.
  void renew(MonotonicTime now);
  /// Records that a browser which may command has connected. A reloaded page resumes the devices
  /// that it operated.
  void on_open(std::uint64_t connection_id, MonotonicTime now);
  /// Records that the browser is gone, which gives it kGoneMax to come back.
  /// @param since  when the connection ended or was last heard
  void on_close(std::uint64_t connection_id, MonotonicTime since);
  /// How much longer the console holds the device's lease after the browser has gone; nullopt if
  /// the browser is connected, or no browser operates the device.
  [[nodiscard]] std::optional<Duration> left(const std::string& device, MonotonicTime now) const;
  /// Releases everything and waits for the result; for the end of the program.
  void release_all();

 private:
  using Step = std::function<gvd::DeviceError(DeviceLink&)>;
  /// Whether the device's sample shows that the step took effect.
  using Effect = std::function<bool(const device::Sample&)>;
  struct Command {
    Step step{};
    bool needs_lease = false;     ///< The console takes the lease over if it has none.
    bool ends_operation = false;  ///< Other browsers may operate the device afterwards.
    Effect effect{};              ///< If empty, the step is complete once answered.
  };

  void add(const char* name, Command command);
  void run(const PendingCall& call, const nlohmann::json& request, const Command& command);
  void release(const std::string& device);

  CallRouter& router_;
  WorkerPool& pool_;
  Post post_;
  Devices devices_;
  struct Operator {
    std::uint64_t connection_id = 0;
    std::optional<MonotonicTime> gone_since{};
  };
  std::map<std::string, Operator> operators_{};  ///< Keyed by device.
  /// The browsers that may command, by connection, with the time of their connect.
  std::map<std::uint64_t, MonotonicTime> browsers_{};
};

}  // namespace rtpm::console
