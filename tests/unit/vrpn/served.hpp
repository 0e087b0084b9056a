#pragma once

#include <gtest/gtest.h>

#include <mutex>
#include <thread>
#include <utility>

#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/semaphore.hpp"
#include "server.hpp"

namespace rtpm::vrpn::test {

/// A device with all that VRPN knows: a pose, two buttons, two analogs, a force.
inline ServedDevice full_device(std::string name = "Arm0") {
  driver::Descriptor descriptor{.model = "test", .serial = "1", .frame = "base"};
  for (const char* axis : {"x", "y", "z", "rx", "ry", "rz"})
    descriptor.axes.push_back({.name = axis, .is_sensed = true, .is_actuated = axis[0] != 'r'});
  descriptor.buttons = {"left", "right"};
  descriptor.analogs = {{.name = "grip", .unit = "1"}, {.name = "light", .unit = "1"}};
  return {std::move(name), std::move(descriptor)};
}

inline driver::Sample full_sample() {
  driver::Sample sample;
  sample.pose = {.position_m = {0.25, -0.5, 0.125}, .orientation = {0, 0, 0.6, 0.8}};
  sample.analogs = {0.75F, 0.5F};
  sample.wrench_applied.force_newton = {0, 1.5, -2};
  return sample;
}

/// A server that publishes `sample` every few milliseconds, on a thread.
class Served {
 public:
  Served() : server_(*Server::create({.port = 0, .devices = {full_device()}})) {
    thread_ = std::thread([this] {
      while (!ending_.wait_until(rt::now() + std::chrono::milliseconds{5})) {
        const std::lock_guard lock(mutex_);
        server_.publish(0, sample_, 1'000'000);
        server_.poll();
      }
    });
  }
  ~Served() {
    ending_.post();
    thread_.join();
  }
  void set(const driver::Sample& sample) {
    const std::lock_guard lock(mutex_);
    sample_ = sample;
  }
  [[nodiscard]] std::size_t client_count() {
    const std::lock_guard lock(mutex_);
    return server_.client_count();
  }
  [[nodiscard]] ServerCounters counters() {
    const std::lock_guard lock(mutex_);
    return server_.counters();
  }
  [[nodiscard]] std::uint16_t port() const { return server_.port(); }

 private:
  std::mutex mutex_;
  Server server_;
  driver::Sample sample_ = full_sample();
  rt::Semaphore ending_{};
  std::thread thread_;
};

}  // namespace rtpm::vrpn::test
