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
/// operates which device.
/// @ownership refers to all that it is given
/// @threads  the web server's
class OperatorDesk {
 public:
  /// How long a browser that operates a device may be gone.
  static constexpr Duration kGoneMax = std::chrono::seconds{5};

  /// Where devices are found.
  struct Devices {
    std::function<std::vector<std::string>()> names{};
    /// Null: there is no such device, or it was not bound yet.
    std::function<std::shared_ptr<DeviceLink>(const std::string&)> link{};
  };

  OperatorDesk(CallRouter& router, WorkerPool& pool, Post post, Devices devices);

  /// Adds the services.
  void start();
  /// Why a connection may not command a device just now; empty: it may.
  [[nodiscard]] std::string refusal(std::uint64_t connection_id, const std::string& device,
                                    bool is_forced) const;
  /// Keeps the leases, forgets those that have ended, and releases those whose browser has been
  /// gone for kGoneMax. Call it a few times per second.
  void renew(MonotonicTime now);
  /// A browser that may command is there: a page that was loaded again goes on with what it
  /// operated.
  void on_open(std::uint64_t connection_id, MonotonicTime now);
  /// The browser has kGoneMax to come back, or had before its end was noticed.
  /// @param since  when it ended or was heard last
  void on_close(std::uint64_t connection_id, MonotonicTime since);
  /// How long the console goes on holding the device's lease, of which the browser is gone;
  /// nullopt: the browser is there, or none operates the device.
  [[nodiscard]] std::optional<Duration> left(const std::string& device, MonotonicTime now) const;
  /// Releases everything and waits for it, at the program's end.
  void release_all();

 private:
  using Step = std::function<gvd::DeviceError(DeviceLink&)>;
  /// Whether the device's sample shows that the step has had its effect.
  using Effect = std::function<bool(const device::Sample&)>;
  struct Command {
    Step step{};
    bool needs_lease = false;     ///< The console takes it over where it has none.
    bool ends_operation = false;  ///< Other browsers may operate the device then.
    Effect effect{};              ///< Empty: it is done when it was answered.
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
  std::map<std::string, Operator> operators_{};        ///< By device.
  std::map<std::uint64_t, MonotonicTime> browsers_{};  ///< That may command, and when they came.
};

}  // namespace rtpm::console
