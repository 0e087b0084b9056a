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

/// Maximum number of remembered devices; further ones are stopped while a name service lists them.
inline constexpr std::size_t kRememberedDeviceCountMax = 4096;

/// A device at one of the servers that its name leads to.
struct StopTarget {
  std::string device{};
  std::string url{};  ///< The URL at which it is bound.
  friend auto operator<=>(const StopTarget&, const StopTarget&) = default;
};

/// The outcome of an emergency stop at one target.
struct StopResult {
  StopTarget target{};
  bool is_stopped = false;
  /// Why it may not be stopped; for a stopped one: why its system was not notified.
  std::string why{};
  MonotonicTime asked{};  ///< When the stop was first requested.
};

/// The outcome of an emergency stop.
struct StopReport {
  std::vector<StopResult> devices{};  ///< In order of names and URLs.
  std::size_t told_hub_count = 0;     ///< Hubs that passed the stop on to all their servers.
  /// Name services and hubs that could not be reached; sentences.
  std::vector<std::string> notes{};
  /// Set if no name service answered: the reason.
  std::optional<SetupError> search_error{};

  [[nodiscard]] std::size_t stopped_count() const noexcept;
  [[nodiscard]] bool is_complete() const noexcept { return stopped_count() == devices.size(); }
};

/// Configures a StopDelivery.
struct StopDeliveryConfig {
  std::string where{names::kThisHost};  ///< Where to search; see names::Directory.
  std::string hub{};                    ///< URL of a hub without a name; may be empty.
  Duration patience = std::chrono::milliseconds{900};  ///< Time limit of stop() and retry().
};

/// Stops devices from outside: directly at their servers and through every hub, at the same time.
/// Tries every server to which a name leads in any name service of the scope, or led until its
/// lease ended, and the servers where a device was seen before. So neither a duplicate name nor a
/// server, registry or hub that hangs prevents the stop of other devices. The stop of a device that
/// could not be reached stays pending, even when its name expires, until retry() delivers it or the
/// device is dismissed.
/// @ownership refers to its node, which must outlive it
/// @threads  any; stop() and retry() may run concurrently
/// @realtime set-up only
class StopDelivery {
 public:
  explicit StopDelivery(rpc::Node& node, StopDeliveryConfig config = {});
  StopDelivery(const StopDelivery&) = delete;
  StopDelivery& operator=(const StopDelivery&) = delete;
  ~StopDelivery();

  /// Remembers where a device is, so that a stop goes there even when its name has expired.
  void remember(const StopTarget& target);
  /// Forgets the remembered targets and the pending stop of a device.
  void dismiss(std::string_view device);

  /// Stops `device`, a name or a URL, and the other devices in `scope`. An empty `device` stops
  /// every device, regardless of `scope`. Blocks for at most StopDeliveryConfig::patience.
  [[nodiscard]] StopReport stop(std::string_view device = {}, StopScope scope = StopScope::kDevice);

  /// Tries to deliver the pending stops to the servers where the devices were last seen and to
  /// those where their names lead now. Gives up a server that no name service lists and that is
  /// absent from its address, once a retry has stopped a new server with the same device name.
  /// @return the targets that it tried
  [[nodiscard]] StopReport retry();
  /// The targets with a pending stop.
  [[nodiscard]] std::vector<StopResult> owed() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtpm::gvd
