#include "remote_device.hpp"

#include <utility>

#include "forking.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::python {
namespace {

/// Below a third of the default lease's silence_max.
constexpr Duration kRenewInterval = std::chrono::milliseconds{250};

}  // namespace

expected<SharedDevice, SetupError> RemoteDevice::open(SharedNode node, const std::string& target,
                                                      Duration hold, Duration patience,
                                                      Duration stall) {
  auto client =
      gvd::DeviceClient::open(node->node, target, {.bind = {}, .hold = hold, .patience = patience});
  if (!client) return unexpected{std::move(client.error())};
  return unforked(
      std::make_unique<RemoteDevice>(std::move(node), std::move(*client), target, stall));
}

RemoteDevice::RemoteDevice(SharedNode node, gvd::DeviceClient client, std::string target,
                           Duration stall)
    : node_(std::move(node)),
      client_(std::move(client)),
      target_(std::move(target)),
      stall_(stall) {}

RemoteDevice::~RemoteDevice() {
  stop_keeping();
}

void RemoteDevice::see() noexcept {
  seen_ns_.store(to_ns(rt::now()), std::memory_order_relaxed);
}

bool RemoteDevice::is_seen() const noexcept {
  return rt::now() - time_from_ns(seen_ns_.load(std::memory_order_relaxed)) < stall_;
}

void RemoteDevice::keep_lease() {
  if (keeper_.joinable()) return;
  see();
  is_ending_ = false;
  keeper_ = std::thread([this] {
    std::unique_lock lock(keeper_mutex_);
    while (!keeper_changed_.wait_for(lock, kRenewInterval, [this] { return is_ending_; })) {
      if (!is_seen()) continue;
      const std::unique_lock client_lock(mutex_, std::try_to_lock);
      // A lost lease shows when the program commands again.
      if (client_lock) static_cast<void>(client_.renew());
    }
  });
}

void RemoteDevice::stop_keeping() {
  if (!keeper_.joinable()) return;
  {
    const std::lock_guard lock(keeper_mutex_);
    is_ending_ = true;
  }
  keeper_changed_.notify_one();
  keeper_.join();
}

}  // namespace rtpm::python
