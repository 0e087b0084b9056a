#pragma once

#include <functional>
#include <holder.rtpm.hpp>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "live/callbacks.hpp"
#include "operators/device_link.hpp"
#include "rtpm/driver/descriptor.hpp"
#include "rtpm/driver/sample.hpp"
#include "rtpm/gvd/client.hpp"
#include "rtpm/rpc/node.hpp"

namespace rtpm::console {

/// The holder of a device's lease, as its server knows it.
struct HolderView {
  bool is_held = false;
  std::string name{};  ///< Empty if it has not introduced itself.
  Duration held_for{};
};

/// The result of one read of a device.
struct DeviceProbe {
  std::string name{};
  std::string problem{};               ///< Why it was not read; empty if it was.
  std::shared_ptr<DeviceLink> link{};  ///< Null if the device is not bound.
  std::shared_ptr<const driver::Descriptor> descriptor{};
  std::string url{};
  std::optional<driver::Sample> sample{};
  std::optional<Duration> latency{};   ///< The latency of the read.
  std::optional<HolderView> holder{};  ///< About once a second, of servers that know it.
};

/// Reads every device periodically and measures the latency. Polls a device that does not answer
/// less often, so that it hardly delays the others.
/// @ownership refers to its node
/// @threads  set_devices(): any; look(): one
class DeviceWatch {
 public:
  explicit DeviceWatch(rpc::Node& node) noexcept : node_(node) {}

  void set_devices(std::vector<std::string> names);
  /// Reads each device that is due, once.
  [[nodiscard]] std::vector<DeviceProbe> look();

 private:
  struct Device {
    std::optional<gvd::DeviceClient> client{};
    std::shared_ptr<DeviceLink> link{};
    std::shared_ptr<const driver::Descriptor> descriptor{};
    MonotonicTime next{};  ///< When it is read next.
    std::optional<device::LeaseHolderClient> holder{};
    MonotonicTime next_holder{};
  };
  [[nodiscard]] DeviceProbe read(const std::string& name, Device& device);
  [[nodiscard]] std::string open(const std::string& name, Device& device);
  [[nodiscard]] std::optional<HolderView> ask_holder(Device& device);

  rpc::Node& node_;
  std::mutex mutex_{};
  std::vector<std::string> names_{};  ///< Guarded by `mutex_`.
  std::map<std::string, Device> devices_{};
};

}  // namespace rtpm::console
