#include "incidents/causes.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <string_view>
#include <utility>

#include "services/json_fields.hpp"

namespace rtpm::console {
namespace {

using incidents::Cause;
using incidents::Severity;
using Json = nlohmann::ordered_json;

/// By then registry, hub and devices were asked.
constexpr double kSettledS = 3;
/// On a busy host a single answer may be late.
constexpr Duration kSilentMin = std::chrono::seconds{2};
constexpr std::uint64_t kFreeLow = std::uint64_t{1} << 30;
constexpr std::uint64_t kFreeAlarm = std::uint64_t{128} << 20;
/// Far above what clocks are slewed by between two looks.
constexpr Duration kJumpMin = std::chrono::milliseconds{100};
/// The texts of driver::to_text() of faults that are incidents by themselves.
constexpr std::array<std::string_view, 5> kFaults{"device data corrupt", "device gone",
                                                  "command not finite", "too fast",
                                                  "implausible pose or time"};
constexpr std::array<std::string_view, 4> kLimits{"force clamped", "force rate limited",
                                                  "power limited", "heat limited"};

const Json& member(const Json& json, const char* key) {
  static const Json kNone = Json::object();
  const auto found = json.find(key);
  return found != json.end() ? *found : kNone;
}

/// The faults of a device that are in `wanted`, in words.
template <std::size_t N>
std::string listed(const Json& device, const std::array<std::string_view, N>& wanted) {
  std::string text;
  for (const Json& one : member(device, "faults")) {
    if (!one.is_string()) continue;
    const auto& fault = one.get_ref<const std::string&>();
    if (std::ranges::count(wanted, fault) == 0) continue;
    text += (text.empty() ? "" : ", ") + fault;
  }
  return text;
}

std::string with_number(const char* format, double value) {
  std::array<char, 64> text{};
  std::snprintf(text.data(), text.size(), format, value);
  return text.data();
}

/// The port of "rtpm://host:port/path"; empty if there is none.
std::string port_of(std::string_view url) {
  constexpr std::string_view kScheme = "rtpm://";
  if (!url.starts_with(kScheme)) return {};
  const std::string_view authority =
      url.substr(kScheme.size()).substr(0, url.substr(kScheme.size()).find('/'));
  const std::size_t colon = authority.rfind(':');
  return colon == std::string_view::npos ? std::string{} : std::string(authority.substr(colon + 1));
}

/// The holder of a lease in words; empty: free, unset: unknown.
std::optional<std::string> holder_of(const Json& lease) {
  const std::string state = fields::text(lease, "state");
  if (state == "free") return "";
  if (state == "unknown" || state.empty()) return std::nullopt;
  const std::string name = fields::text(member(lease, "operator"), "name");
  if (state == "held by this console") return name.empty() ? "an operator of this console" : name;
  const std::string holder = fields::text(lease, "holder");
  return holder.empty() ? "another program" : holder;
}

}  // namespace

CauseFinder::Found CauseFinder::find(const Json& state, const std::vector<DiskSpace>& disks,
                                     const incidents::Moment& moment) {
  Found found;
  is_settled_ = fields::number(state, "uptime_s") >= kSettledS;
  find_services(state, found, moment.time);
  find_devices(state, found, moment);
  find_servers(state, found);
  find_recording(state, found);
  for (const DiskSpace& disk : disks) {
    if (disk.free_bytes >= kFreeLow) continue;
    found.lasting.push_back(
        {.who = "disk",
         .what = "disk low",
         .why = with_number("%.0f MiB are free", static_cast<double>(disk.free_bytes >> 20)) +
                " for " + disk.folder,
         .severity = disk.free_bytes < kFreeAlarm ? Severity::kAlarm : Severity::kWarning});
  }
  find_clock_jump(moment, found);
  before_ = moment;
  return found;
}

bool CauseFinder::lasts(const std::string& key, bool is_wrong, MonotonicTime now) {
  if (!is_wrong || !is_settled_) {
    wrong_since_.erase(key);
    return false;
  }
  return now - wrong_since_.try_emplace(key, now).first->second >= kSilentMin;
}

void CauseFinder::find_services(const Json& state, Found& found, MonotonicTime now) {
  const Json& registry = member(state, "registry");
  if (lasts("registry", !fields::flag(registry, "ok"), now)) {
    found.lasting.push_back({.who = "registry",
                             .what = "silent",
                             .why = fields::text(registry, "problem"),
                             .severity = Severity::kAlarm});
  }
  const Json& hub = member(state, "hub");
  if (lasts("hub", !fields::flag(hub, "ok"), now)) {
    found.lasting.push_back({.who = "hub " + fields::text(hub, "name"),
                             .what = "silent",
                             .why = fields::text(hub, "problem"),
                             .severity = Severity::kWarning});
  }
}

void CauseFinder::find_devices(const Json& state, Found& found, const incidents::Moment& moment) {
  std::set<std::string> names;
  for (const Json& device : member(state, "devices")) {
    const std::string name = fields::text(device, "name");
    names.insert(name);
    const auto add = [&](const char* what, std::string why, Severity severity) {
      found.lasting.push_back({name, what, std::move(why), severity});
    };
    find_lease(name, device, found);
    const Json& lost = member(device, "lost_for_s");
    const bool is_late = !lost.is_number() && !fields::flag(device, "ok");
    if (lasts("device " + name, is_late, moment.time)) {
      add("late", fields::text(device, "problem"), Severity::kAlarm);
    }
    if (lost.is_number()) {
      const double lost_s = std::max(lost.get<double>(), 0.0);
      add("lost", fields::text(device, "problem"), Severity::kAlarm);
      found.lasting.back().since_ns = moment.utc_ns - static_cast<std::uint64_t>(lost_s * 1e9);
      continue;
    }
    if (fields::flag(device, "is_stopped")) {
      add("stopped", "an emergency stop is in force", Severity::kAlarm);
    }
    if (std::string faults = listed(device, kFaults); !faults.empty()) {
      add("fault", std::move(faults), Severity::kAlarm);
    } else if (fields::text(device, "lifecycle") == "fault") {
      add("fault", "the device is in the state fault", Severity::kAlarm);
    }
    if (std::string limits = listed(device, kLimits); !limits.empty()) {
      add("limit", std::move(limits), Severity::kInfo);
    }
  }
  std::erase_if(holders_, [&](const auto& each) { return !names.contains(each.first); });
  std::erase_if(wrong_since_, [&](const auto& each) {
    return each.first.starts_with("device ") && !names.contains(each.first.substr(7));
  });
  for (const Json& one : member(state, "not_stopped")) {
    found.lasting.push_back({.who = fields::text(one, "device"),
                             .what = "not stopped",
                             .why = fields::text(one, "why"),
                             .severity = Severity::kAlarm});
  }
}

void CauseFinder::find_lease(const std::string& name, const Json& device, Found& found) {
  const auto holder = holder_of(member(device, "lease"));
  if (!holder) return;
  const auto [known, is_new] = holders_.emplace(name, *holder);
  const std::string before = std::exchange(known->second, *holder);
  if (is_new || before == *holder) return;
  // A holder introduces itself a moment after it has the lease.
  if (before == "another program" && !holder->empty()) return;
  const bool is_taken_over = !before.empty() && !holder->empty();
  found.events.push_back(
      {.who = name,
       .what = "lease",
       .why = (before.empty() ? "free" : before) + " → " + (holder->empty() ? "free" : *holder),
       .severity = is_taken_over ? Severity::kWarning : Severity::kInfo});
}

// Servers of this host that belong to other laboratories are not this one's incidents.
void CauseFinder::find_servers(const Json& state, Found& found) {
  std::set<std::string> ports;
  for (const Json& object : member(state, "objects"))
    ports.insert(port_of(fields::text(object, "url")));
  for (const Json& server : member(state, "servers")) {
    const auto process_id = static_cast<std::int64_t>(fields::number(server, "process_id"));
    const auto port = std::to_string(static_cast<std::int64_t>(fields::number(server, "port")));
    if (fields::flag(server, "alive")) {
      if (ports.contains(port)) own_servers_.insert(process_id);
    } else if (own_servers_.contains(process_id)) {
      found.lasting.push_back(
          {.who = fields::text(server, "name"),
           .what = "server lost",
           .why = "process " + std::to_string(process_id) + " ended without a word",
           .severity = Severity::kAlarm});
    }
  }
}

void CauseFinder::find_recording(const Json& state, Found& found) {
  const Json& recording = member(state, "recording");
  const std::string file = fields::text(recording, "file");
  if (const std::string problem = fields::text(recording, "problem"); !problem.empty()) {
    found.lasting.push_back({.who = file.empty() ? "recorder" : file,
                             .what = "recording",
                             .why = problem,
                             .severity = Severity::kAlarm});
  }
  const auto drop_count = static_cast<std::uint64_t>(fields::number(recording, "drop_count"));
  const std::uint64_t before = std::exchange(recorded_file_, file) == file ? drop_count_ : 0;
  drop_count_ = drop_count;
  if (file.empty() || drop_count <= before) return;
  found.events.push_back({.who = file,
                          .what = "dropped",
                          .why = std::to_string(drop_count) + " messages are missing so far",
                          .severity = Severity::kWarning,
                          .is_sum = true});
}

void CauseFinder::find_clock_jump(const incidents::Moment& moment, Found& found) {
  if (!before_) return;
  const Duration passed = moment.time - before_->time;
  const auto utc_passed = Duration{static_cast<std::int64_t>(moment.utc_ns - before_->utc_ns)};
  const Duration jump = utc_passed - passed;
  if (std::chrono::abs(jump) < kJumpMin) return;
  found.events.push_back({.who = "clock",
                          .what = "clock jumped",
                          .why = with_number("the wall clock was set by %+.3f s",
                                             std::chrono::duration<double>(jump).count()) +
                                 "; times of recordings before and after differ by that",
                          .severity = Severity::kWarning});
}

}  // namespace rtpm::console
