#include "live/device_watch.hpp"

#include <algorithm>
#include <utility>

#include "rtpm/base/printable.hpp"
#include "rtpm/gvd/holder.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::console {
namespace {

constexpr Duration kOpenDeadline = std::chrono::milliseconds{300};
constexpr Duration kReadDeadline = std::chrono::milliseconds{50};
/// The interval between a failure and the next attempt.
constexpr Duration kRetryInterval = std::chrono::seconds{1};
constexpr Duration kHolderInterval = std::chrono::seconds{1};
constexpr std::size_t kHolderSizeMax = 160;

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
  if (sample && begin >= device.next_holder) {
    device.next_holder = begin + kHolderInterval;
    probe.holder = ask_holder(device);
  }
  probe.link = device.link;
  probe.descriptor = device.descriptor;
  if (device.client) probe.url = device.client->url();
  return probe;
}

std::optional<HolderView> DeviceWatch::ask_holder(Device& device) {
  if (!device.holder) return std::nullopt;
  const auto reply =
      device.holder->holder({}, {.priority = Priority{0}, .deadline = kReadDeadline});
  if (!reply) return std::nullopt;
  const device::HolderReply& holder = **reply;
  HolderView view{.is_held = holder.is_held(),
                  .name = printable(holder.name()->string_view(), kHolderSizeMax),
                  .held_for = std::chrono::microseconds{holder.held_us()}};
  const std::string key_name = printable(holder.key_name()->string_view(), kHolderSizeMax);
  if (!key_name.empty()) view.name += view.name.empty() ? key_name : ", key of " + key_name;
  return view;
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
  // An older server knows no holder.
  rpc::BindOptions bind;
  bind.deadline = kOpenDeadline;
  auto holder =
      device::LeaseHolderClient::bind(node_, gvd::holder_path(device.client->url()), bind);
  device.holder.reset();
  if (holder) device.holder.emplace(std::move(*holder));
  return {};
}

}  // namespace rtpm::console
