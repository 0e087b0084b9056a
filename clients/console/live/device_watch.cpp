#include "live/device_watch.hpp"

#include <algorithm>
#include <utility>

#include "rtpm/rt/clock.hpp"

namespace rtpm::console {
namespace {

constexpr Duration kOpenDeadline = std::chrono::milliseconds{300};
constexpr Duration kReadDeadline = std::chrono::milliseconds{50};
/// The interval between a failure and the next attempt.
constexpr Duration kRetryInterval = std::chrono::seconds{1};

}  // namespace

void DeviceWatch::set_devices(std::vector<std::string> names) {
  const std::lock_guard lock(mutex_);
  names_ = std::move(names);
}

std::vector<DeviceProbe> DeviceWatch::look() {
  std::vector<std::string> names;
  {
    const std::lock_guard lock(mutex_);
    names = names_;
  }
  std::erase_if(devices_, [&](const auto& one) { return !std::ranges::count(names, one.first); });
  std::vector<DeviceProbe> probes;
  for (const std::string& name : names) {
    Device& device = devices_[name];
    if (rt::now() < device.next) continue;
    probes.push_back(read(name, device));
    if (!probes.back().problem.empty()) device.next = rt::now() + kRetryInterval;
  }
  return probes;
}

DeviceProbe DeviceWatch::read(const std::string& name, Device& device) {
  DeviceProbe probe{.name = name};
  if (!device.client) {
    probe.problem = open(name, device);
    if (!probe.problem.empty()) return probe;
  }
  const MonotonicTime begin = rt::now();
  // The lowest priority, so that the read never delays a force loop.
  const auto sample = device.client->read({.priority = Priority{0}, .deadline = kReadDeadline});
  if (sample) {
    probe.latency = rt::now() - begin;
    probe.sample = *sample;
  } else {
    probe.problem = std::string(to_string(sample.error()));
    // Another device may have taken over the name.
    if (sample.error() != gvd::DeviceOutcome::kNoSample) device.client.reset();
  }
  probe.link = device.link;
  probe.descriptor = device.descriptor;
  if (device.client) probe.url = device.client->url();
  return probe;
}

std::string DeviceWatch::open(const std::string& name, Device& device) {
  gvd::DeviceClientOptions options;
  options.bind.deadline = kOpenDeadline;
  auto client = gvd::DeviceClient::open(node_, name, options);
  if (!client) return client.error().reason();
  // The link is kept while it may hold a lease; it follows the name by itself.
  if (!device.link) {
    auto link = DeviceLink::open(node_, name, kOpenDeadline);
    if (!link) return link.error().reason();
    device.link = std::move(*link);
  }
  device.descriptor = std::make_shared<const driver::Descriptor>(client->descriptor());
  device.client.emplace(std::move(*client));
  return {};
}

}  // namespace rtpm::console
