#include "rtpm/gvd/stop_delivery.hpp"

#include <algorithm>
#include <map>
#include <mutex>
#include <set>
#include <utility>

#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/pi_mutex.hpp"
#include "rtpm/wire/url.hpp"
#include "stop/stop_round.hpp"

namespace rtpm::gvd {
namespace {

constexpr std::string_view kDeviceInterface = "rtpm.device.Device";

using Tried = std::map<StopTarget, StopRound::Tried>;

/// The target of `device`, if `entry` binds it or a name above it.
std::optional<StopTarget> target_of(const names::NameEntry& entry, const std::string& device) {
  if (entry.name == device) return StopTarget{device, entry.url};
  if (!device.starts_with(entry.name + "/")) return std::nullopt;
  return StopTarget{device, entry.url + device.substr(entry.name.size())};
}

std::optional<StopTarget> any_device(const names::NameEntry& entry) {
  if (entry.interface != kDeviceInterface) return std::nullopt;
  return StopTarget{entry.name, entry.url};
}

}  // namespace

std::size_t StopReport::stopped_count() const noexcept {
  return static_cast<std::size_t>(std::ranges::count_if(devices, &StopResult::is_stopped));
}

struct StopDelivery::Impl {
  /// A device with pending stops.
  struct Owed {
    StopScope scope{};
    std::map<StopTarget, StopResult> missing{};
    std::set<StopTarget> stopped{};  ///< Not stopped again: it may be rearmed by now.
    bool has_new_server = false;     ///< A server that appeared after the request was stopped.
  };

  /// Updates the pending stops with a round's results.
  /// @return the results that count
  std::vector<StopResult> settle(const Tried& tried, StopScope scope, MonotonicTime begin,
                                 bool is_retry) {
    for (const auto& [target, one] : tried) {
      if (!one.is_stopped) continue;
      Owed& of = owed[target.device];
      of.missing.erase(target);
      if (of.stopped.insert(target).second) of.has_new_server |= is_retry;
    }
    std::vector<StopResult> results;
    for (const auto& [target, one] : tried) {
      StopResult result{target, one.is_stopped, one.why, begin};
      if (!one.is_stopped) {
        Owed& of = owed[target.device];
        const bool has_other = is_retry ? of.has_new_server : !of.stopped.empty();
        if (has_other && one.is_absent && !one.is_listed) {
          of.missing.erase(target);
          remembered.erase(target);
          continue;
        }
        if (!is_retry) of.scope = scope;
        const auto known = of.missing.find(target);
        if (known != of.missing.end()) result.asked = known->second.asked;
        if (missing_count() < kRememberedDeviceCountMax || known != of.missing.end()) {
          of.missing.insert_or_assign(target, result);
        }
      }
      results.push_back(std::move(result));
    }
    std::erase_if(owed, [](const auto& one) { return one.second.missing.empty(); });
    return results;
  }

  [[nodiscard]] std::size_t missing_count() const {
    std::size_t count = 0;
    for (const auto& [device, of] : owed)
      count += of.missing.size();
    return count;
  }

  rpc::Node& node;
  const StopDeliveryConfig config;
  mutable rt::PiMutex mutex{};  ///< Guards the members below.
  std::set<StopTarget> remembered{};
  std::map<std::string, Owed, std::less<>> owed{};
};

StopDelivery::StopDelivery(rpc::Node& node, StopDeliveryConfig config)
    : impl_(new Impl{node, std::move(config)}) {}
StopDelivery::~StopDelivery() = default;

void StopDelivery::remember(const StopTarget& target) {
  const std::lock_guard lock(impl_->mutex);
  if (impl_->remembered.size() < kRememberedDeviceCountMax) impl_->remembered.insert(target);
}

void StopDelivery::dismiss(std::string_view device) {
  const std::lock_guard lock(impl_->mutex);
  std::erase_if(impl_->remembered, [&](const StopTarget& one) { return one.device == device; });
  const auto found = impl_->owed.find(device);
  if (found != impl_->owed.end()) impl_->owed.erase(found);
}

StopReport StopDelivery::stop(std::string_view device, StopScope scope) {
  const bool is_all = device.empty();
  const MonotonicTime begin = rt::now();
  StopRoundConfig config{.where = impl_->config.where,
                         .hub = impl_->config.hub,
                         .begin = begin,
                         .deadline = begin + impl_->config.patience,
                         .tells_hubs = is_all || scope == StopScope::kSystem};
  config.choose = [is_all, name = std::string(device)](const names::NameEntry& entry) {
    return is_all ? any_device(entry) : target_of(entry, name);
  };
  config.scope_of = [scope = is_all ? StopScope::kSystem : scope](const std::string&) {
    return scope;
  };
  StopRound round(impl_->node, std::move(config));
  {
    const std::lock_guard lock(impl_->mutex);
    for (const StopTarget& target : impl_->remembered) {
      if (is_all || target.device == device) round.add(target);
    }
    for (const auto& [name, of] : impl_->owed) {
      for (const auto& [target, result] : of.missing) {
        if (is_all || name == device) round.add(target);
      }
    }
  }
  if (wire::is_url(device)) round.add({std::string(device), std::string(device)});
  round.run();
  StopReport report = round.take_report();
  const std::lock_guard lock(impl_->mutex);
  report.devices = impl_->settle(round.tried(), is_all ? StopScope::kDevice : scope, begin,
                                 /*is_retry=*/false);
  return report;
}

StopReport StopDelivery::retry() {
  const MonotonicTime begin = rt::now();
  std::map<std::string, Impl::Owed, std::less<>> owed;
  {
    const std::lock_guard lock(impl_->mutex);
    owed = impl_->owed;
  }
  if (owed.empty()) return {};
  StopRoundConfig config{
      .where = impl_->config.where, .begin = begin, .deadline = begin + impl_->config.patience};
  config.choose = [&owed](const names::NameEntry& entry) -> std::optional<StopTarget> {
    for (const auto& [device, of] : owed) {
      auto target = target_of(entry, device);
      if (target && !of.stopped.contains(*target)) return target;
    }
    return std::nullopt;
  };
  config.scope_of = [&owed](const std::string& device) { return owed.find(device)->second.scope; };
  StopRound round(impl_->node, std::move(config));
  for (const auto& [device, of] : owed) {
    for (const auto& [target, result] : of.missing)
      round.add(target);
  }
  round.run();
  StopReport report = round.take_report();
  const std::lock_guard lock(impl_->mutex);
  // Dismissed devices have no pending stop.
  Tried tried = round.tried();
  std::erase_if(tried, [this](const auto& one) { return !impl_->owed.contains(one.first.device); });
  report.devices = impl_->settle(tried, {}, begin, /*is_retry=*/true);
  return report;
}

std::vector<StopResult> StopDelivery::owed() const {
  const std::lock_guard lock(impl_->mutex);
  std::vector<StopResult> results;
  for (const auto& [device, of] : impl_->owed) {
    for (const auto& [target, result] : of.missing)
      results.push_back(result);
  }
  return results;
}

}  // namespace rtpm::gvd
