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

  /// How long the operator of a device has to answer a request for it.
  static constexpr Duration kAnswerMax = std::chrono::seconds{30};

  /// A person at a browser, as it has said; empty if it has not.
  struct Person {
    std::string name{};
    std::string room{};
  };

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
  /// Adds `operator` and `request`, for whom a device's lease is held and who asks for it, to the
  /// `lease` member of the device in `console/state`.
  void add_operator(const std::string& device, MonotonicTime now,
                    nlohmann::ordered_json& lease) const;
  /// The name of the operator at a connection; empty if it has given none.
  [[nodiscard]] std::string name_of(std::uint64_t connection_id) const;
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
  void set_person(const PendingCall& call, const nlohmann::json& request);
  void keep_lease(const PendingCall& call, const nlohmann::json& request);
  void ask_for_lease(const PendingCall& call, const nlohmann::json& request);
  void answer_for_lease(const PendingCall& call, const nlohmann::json& request);
  /// Ends the operation of a device; a request for it fails, as it is free now.
  void end_operation(const std::string& device);
  /// Names the lease's holder at the device's server.
  void introduce(const std::string& device);
  [[nodiscard]] std::string holder_text(const std::string& device) const;

  CallRouter& router_;
  WorkerPool& pool_;
  Post post_;
  Devices devices_;
  /// Another operator asks for the device. Its call is answered when it is decided.
  struct Request {
    PendingCall call{};
    Person person{};
    MonotonicTime ends{};
  };
  struct Operator {
    std::uint64_t connection_id = 0;
    Person person{};
    std::uint64_t since_ns = 0;                 ///< In UTC.
    std::optional<MonotonicTime> gone_since{};  ///< The browser is disconnected.
    bool is_kept = false;                       ///< Also while the browser is gone.
    std::optional<Request> request{};
  };
  struct Browser {
    MonotonicTime since{};
    Person person{};
  };
  std::map<std::string, Operator> operators_{};  ///< Keyed by device.
  std::map<std::uint64_t, Browser> browsers_{};  ///< Those that may command, by connection.
};

}  // namespace rtpm::console
