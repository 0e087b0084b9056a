#include "driver_watch.hpp"

#include <array>
#include <cstdio>

#include "rtpm/rt/clock.hpp"

namespace rtpm::deviced {
namespace {

constexpr Duration kInterval = std::chrono::milliseconds{100};

/// Formats a time like "5.0 s".
std::string text_of(Duration time) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.1f s", std::chrono::duration<double>(time).count());
  return text.data();
}

}  // namespace

DriverWatch::~DriverWatch() {
  is_stopping_.store(true, std::memory_order_relaxed);
  if (thread_.is_running()) thread_.join();
}

expected<void, SetupError> DriverWatch::start() {
  auto started =
      rt::Thread::start({.name = "driver-watch", .realtime = rt::RealtimeMode::kOff}, [this] {
        while (!is_stopping_.load(std::memory_order_relaxed)) {
          for (Device& device : devices_)
            look_at(device);
          rt::sleep_until(rt::now() + kInterval);
        }
      });
  if (!started) return unexpected{std::move(started.error())};
  thread_ = std::move(*started);
  return {};
}

void DriverWatch::look_at(Device& device) {
  const Duration silence = device.server->silence();
  if (silence >= kBlockedMin) {
    if (device.blocked == Duration{0}) {
      log_.write(device.name + ": its driver has not returned for " + text_of(silence) +
                 "; its last sample stands, and no command has an effect");
    }
    device.blocked = silence;
  } else if (device.blocked != Duration{0}) {
    log_.write(device.name + ": its driver has returned, after about " + text_of(device.blocked));
    device.blocked = Duration{0};
  }
}

}  // namespace rtpm::deviced
