#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <memory>
#include <thread>

#include "rtpm/driver/driver.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::device_evdev {

/// A driver from open(), in real time.
class OpenedDriver : public testing::Test {
 protected:
  /// The driver ends before the device does.
  void TearDown() override { driver_.reset(); }
  void start() {
    const auto configured = driver_->configure({.period = std::chrono::milliseconds{1}});
    ASSERT_TRUE(configured) << configured.error().text();
    const auto activated = driver_->activate();
    ASSERT_TRUE(activated) << activated.error().text();
  }
  /// Exchanges each millisecond until `is_done`, for some 4 s.
  bool exchange_until(driver::CommandMode mode, double value,
                      const std::function<bool(driver::ExchangeStatus)>& is_done) {
    for (int i = 0; i < 4000; ++i) {
      driver::Command command;
      command.mode = mode;
      command.cycle_time = rt::now();
      command.joints[0] = value;
      command.outputs.fill(static_cast<float>(value));
      sample_.faults = {};
      if (is_done(driver_->exchange(command, sample_))) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds{1});
    }
    return false;
  }

  std::unique_ptr<driver::Driver> driver_{};
  driver::Sample sample_{};
};

}  // namespace rtpm::device_evdev
