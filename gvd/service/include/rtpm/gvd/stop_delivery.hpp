#pragma once

#include <chrono>
#include <compare>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/gvd/emergency.hpp"
#include "rtpm/names/defaults.hpp"
#include "rtpm/rpc/node.hpp"

namespace rtpm::gvd {

/// Maximum of remembered devices; further ones are stopped as long as a name service has them.
inline constexpr std::size_t kRememberedDeviceCountMax = 4096;

/// A device at one of the servers to which its name leads.
struct StopTarget {
  std::string device{};
  std::string url{};  ///< The URL at which it is bound.
  friend auto operator<=>(const StopTarget&, const StopTarget&) = default;
};

/// The outcome of an emergency stop at one target.
struct StopResult {
  StopTarget target{};
  bool is_stopped = false;
  /// Why it is not known to be stopped; for a stopped one: why its system was not notified.
  std::string why{};
  MonotonicTime asked{};  ///< When the stop was first asked for.
};

/// The outcome of an emergency stop.
struct StopReport {
  std::vector<StopResult> devices{};  ///< In the order of names and URLs.
  std::size_t told_hub_count = 0;     ///< Hubs that passed the stop on to all servers there.
  std::vector<std::string> notes{};   ///< Name services and hubs that were not reached; sentences.
  /// Why no name service answered, if none did.
  std::optional<SetupError> search_error{};

  [[nodiscard]] std::size_t stopped_count() const noexcept;
  [[nodiscard]] bool is_complete() const noexcept { return stopped_count() == devices.size(); }
};

/// Configures a StopDelivery.
struct StopDeliveryConfig {
  std::string where{names::kThisHost};  ///< A place for names::Directory.
  std::string hub{};                    ///< URL of a hub without a name; may be empty.
  Duration patience = std::chrono::milliseconds{900};  ///< Time limit of stop() and retry().
};

/// Stops devices from outside: each at its own server and through every hub, at the same time. It
/// tries every server to which a name leads in any name service of the scope, or led until its
/// lease ended, and the servers where a device was seen before. So neither a name that is bound
/// twice nor a server, registry or hub that hangs keeps a stop from the other devices. A device
/// that was not reached is owed its stop, also when its name expires, until retry() has delivered
/// it or the device is dismissed.
/// @ownership refers to its node, which must outlive it
/// @threads  any; stop() and retry() may run at the same time
/// @realtime set-up only
class StopDelivery {
 public:
  explicit StopDelivery(rpc::Node& node, StopDeliveryConfig config = {});
  StopDelivery(const StopDelivery&) = delete;
  StopDelivery& operator=(const StopDelivery&) = delete;
  ~StopDelivery();

  /// Notes where a device is seen, so that a stop goes there also when its name has expired.
  void remember(const StopTarget& target);
  /// Drops the remembered targets of a device, and the stop that it is owed.
  void dismiss(std::string_view device);

  /// Stops `device`, a name or a URL, and the further devices of `scope`. An empty `device` stops
  /// every device, whatever `scope`. Blocks for StopDeliveryConfig::patience at most.
  [[nodiscard]] StopReport stop(std::string_view device = {}, StopScope scope = StopScope::kDevice);

  /// Tries to deliver the stops that are owed, at the servers where the devices were and at those
  /// to which the names lead now. It gives up a server at whose address nothing listens, once
  /// another one with its device's name was stopped.
  /// @return the targets that were tried
  [[nodiscard]] StopReport retry();
  /// The targets that are owed a stop.
  [[nodiscard]] std::vector<StopResult> owed() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtpm::gvd
