#pragma once

#include <cstdint>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "live/device_watch.hpp"
#include "live/latency_window.hpp"
#include "operators/device_link.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/gvd/device_event.hpp"

namespace rtpm::console {

/// The known state of a device, and its age.
/// @threads  the web server's thread
class DeviceState {
 public:
  explicit DeviceState(std::string name) : name_(std::move(name)) {}

  void take(const DeviceProbe& probe, MonotonicTime now);
  /// Processes a sample that the hub delivered.
  void take_sample(std::uint64_t sequence, MonotonicTime now);
  void take_lease(gvd::LeaseState state, MonotonicTime since);
  /// Records that the device's name is bound at this name service.
  void set_bound(const std::string& service_url);
  /// Records that the device's name has expired: its server hangs, is dead, or is cut off.
  void set_lost(MonotonicTime since, const std::string& url);

  [[nodiscard]] const std::string& name() const noexcept { return name_; }
  [[nodiscard]] bool is_lost() const noexcept { return lost_since_.has_value(); }
  [[nodiscard]] const std::string& service_url() const noexcept { return service_url_; }
  [[nodiscard]] const std::shared_ptr<DeviceLink>& link() const noexcept { return link_; }
  [[nodiscard]] nlohmann::ordered_json json(MonotonicTime now, bool has_config,
                                            std::optional<Duration> lease_left) const;
  [[nodiscard]] LatencyWindow& latency() noexcept { return latency_; }

 private:
  void see_sequence(std::uint64_t sequence, MonotonicTime now);

  std::string name_;
  std::string url_{};
  std::string service_url_{};
  std::optional<MonotonicTime> lost_since_{};
  std::string problem_{"not asked yet"};
  std::shared_ptr<DeviceLink> link_{};
  std::shared_ptr<const driver::Descriptor> descriptor_{};
  std::optional<driver::Sample> sample_{};  ///< The sample of the newest read.
  std::uint64_t sequence_ = 0;              ///< The newest sequence.
  std::optional<MonotonicTime> newest_{};   ///< When `sequence_` arrived.
  // The sequence of about a second ago, for computing the rate.
  std::uint64_t rate_sequence_ = 0;
  std::optional<MonotonicTime> rate_begin_{};
  double sample_per_s_ = 0;
  [[nodiscard]] nlohmann::ordered_json lease_json(MonotonicTime now,
                                                  std::optional<Duration> lease_left) const;

  gvd::LeaseState lease_ = gvd::LeaseState::kUnknown;  ///< By its events.
  std::optional<MonotonicTime> lease_since_{};
  std::optional<HolderView> holder_{};  ///< By the device's server; nullopt if that knows none.
  std::optional<MonotonicTime> held_since_{};
  LatencyWindow latency_{};
};

}  // namespace rtpm::console
