#pragma once

#include <atomic>
#include <cstdint>
#include <device.rtpm.hpp>
#include <memory>
#include <string>
#include <string_view>

#include "rtpm/base/priority.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/gvd/holder.hpp"
#include "rtpm/rpc/node.hpp"

namespace rtpm::console {

/// A bound device and the console's lease on it, shared by all threads.
/// @ownership refers to the node
/// @threads  any
class DeviceLink {
 public:
  [[nodiscard]] static expected<std::shared_ptr<DeviceLink>, SetupError> open(
      rpc::Node& node, std::string_view device, Duration deadline) {
    rpc::BindOptions options;
    options.deadline = deadline;
    auto stub = device::DeviceClient::bind(node, device, options);
    if (!stub) return unexpected{stub.error()};
    auto link = std::shared_ptr<DeviceLink>(new DeviceLink(node, std::move(*stub)));
    rpc::CallOptions call;
    call.deadline = deadline;
    const auto description = link->stub_.describe({}, call);
    if (!description) return setup_error("it does not describe itself", description.error());
    link->operator_priority_ =
        Priority{std::min<int>((*description)->operator_priority(), Priority::kHighest)};
    return link;
  }

  [[nodiscard]] device::DeviceClient& stub() noexcept { return stub_; }
  /// Names the holder of the console's lease at the device's server; blocks for at most 0.4 s.
  void introduce(std::string_view name) {
    if (const std::uint64_t held = lease(); held != 0) {
      gvd::introduce(node_, stub_.binding().url(), held, name);
    }
  }
  /// The priority for taking over the lease.
  [[nodiscard]] Priority operator_priority() const noexcept { return operator_priority_; }
  /// The console's lease; 0 if it has none.
  [[nodiscard]] std::uint64_t lease() const noexcept { return lease_.load(); }
  void set_lease(std::uint64_t lease) noexcept { lease_.store(lease); }

 private:
  DeviceLink(rpc::Node& node, device::DeviceClient stub) noexcept
      : node_(node), stub_(std::move(stub)) {}

  rpc::Node& node_;
  device::DeviceClient stub_;
  Priority operator_priority_{};
  std::atomic<std::uint64_t> lease_{0};
};

}  // namespace rtpm::console
