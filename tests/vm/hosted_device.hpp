#pragma once

#include <gtest/gtest.h>

#include <optional>
#include <string>

#include "../system/programs.hpp"
#include "guest.hpp"
#include "rtpm/gvd/client.hpp"
#include "rtpm/names/resolver.hpp"
#include "rtpm/rpc/node.hpp"

namespace rtpm::vm_test {

/// A device that rtpm-deviced serves as lab/unit by a driver of hardware, and its client.
class HostedDevice : public testing::Test {
 protected:
  /// Starts the programs and opens the client. If that fails, the test fails, and so must its
  /// caller.
  [[nodiscard]] bool host(const std::string& driver, const std::string& arguments) {
    registry_ = system_test::start_daemon("rtpm-registryd", {"--port", "0"});
    if (!registry_) return false;
    device_ = system_test::start_daemon(
        "rtpm-deviced", {"--port", "0", "--registry", registry_->url, "--devices", "unit",
                         "--device-unit-driver", driver, "--device-unit-arguments", arguments});
    if (!device_) return false;
    resolver_.emplace(node_, registry_->url);
    node_.use(*resolver_);
    auto client = gvd::DeviceClient::open(
        node_, "lab/unit",
        {.bind = {.deadline = kPatience}, .hold = std::chrono::milliseconds{100}});
    if (!client) {
      ADD_FAILURE() << client.error().text();
      return false;
    }
    client_.emplace(std::move(*client));
    return true;
  }

  /// Waits for a sample that fits.
  template <class Fits>
  [[nodiscard]] bool await_sample(Fits fits) {
    return await([&] {
      const auto sample = client_->read(kPatient);
      return sample && fits(*sample);
    });
  }
  [[nodiscard]] bool await_lifecycle(driver::Lifecycle lifecycle) {
    return await_sample(
        [&](const driver::Sample& sample) { return sample.lifecycle == lifecycle; });
  }
  /// Sends the setpoint repeatedly until `is_so`, as a client's loop does.
  template <class Condition>
  [[nodiscard]] bool command_until(const driver::Setpoint& setpoint, Condition is_so) {
    return await([&] {
      static_cast<void>(client_->set(setpoint, kPatient));
      return is_so();
    });
  }

  static constexpr rpc::CallOptions kPatient{.deadline = std::chrono::seconds{1}};
  rpc::Node node_{{.wait = {.strategy = rt::WaitStrategy::kBlock}}};
  std::optional<system_test::Daemon> registry_{};
  std::optional<system_test::Daemon> device_{};
  std::optional<names::RegistryResolver> resolver_{};
  std::optional<gvd::DeviceClient> client_{};
};

}  // namespace rtpm::vm_test
