#include "review/marks.hpp"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <cstring>
#include <device_events.rtpm.events.hpp>
#include <limits>
#include <trial.rtpm.events.hpp>

#include "rtpm/base/nesting.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/capture/channels.hpp"
#include "rtpm/capture/read_events.hpp"
#include "rtpm/driver/sample.hpp"
#include "rtpm/gvd/lease.hpp"

namespace rtpm::console {
namespace {

using OrderedJson = nlohmann::ordered_json;

/// Trials without an end, and incidents that last, at a time; the oldest is forgotten.
constexpr std::size_t kOpenCountMax = 1024;
constexpr std::size_t kLabelSizeMax = 200;
constexpr unsigned kStopBit = 32;

std::string shown(std::string_view text) {
  return printable(text, kLabelSizeMax);
}
std::string shown(const flatbuffers::String* text) {
  return text == nullptr ? "" : shown(text->string_view());
}

/// The struct that a device's event holds; nullopt if the bytes are none.
template <class Struct>
std::optional<Struct> struct_of(ConstBytes table) {
  const ConstBytes bytes = capture::struct_in_table(table, sizeof(Struct));
  if (bytes.empty()) return std::nullopt;
  Struct found;
  std::memcpy(&found, bytes.data(), sizeof found);
  return found;
}

OrderedJson time_or_null(const std::optional<std::uint64_t>& time_ns) {
  return time_ns ? OrderedJson(*time_ns) : OrderedJson();
}

}  // namespace

Marks::Marks(const recording::FileReader& reader) {
  constexpr std::array<std::pair<std::string_view, Role>, 4> kRoles{
      {{"rtpm.Trial", Role::kTrial},
       {"rtpm.device.FaultChanged", Role::kFault},
       {"rtpm.device.StopChanged", Role::kStop},
       {"rtpm.device.LeaseChanged", Role::kLease}}};
  for (const auto& [number, channel] : reader.channels()) {
    Source source{.device = shown(capture::value_of(channel, capture::kDeviceKey)),
                  .event_source = std::strtoull(
                      capture::value_of(channel, capture::kSourceKey).c_str(), nullptr, 10)};
    if (source.device.empty()) source.device = shown(channel.topic);
    if (channel.topic == capture::kAnnotationTopic && channel.message_encoding == "json") {
      source.role = Role::kNote;
      sources_.emplace(number, std::move(source));
      continue;
    }
    const auto schema = reader.schemas().find(channel.schema_id);
    if (schema == reader.schemas().end()) continue;
    const auto role =
        std::ranges::find(kRoles, schema->second.name, &decltype(kRoles)::value_type::first);
    if (role == kRoles.end()) continue;
    source.role = role->second;
    sources_.emplace(number, std::move(source));
  }
}

std::vector<std::uint16_t> Marks::channels() const {
  std::vector<std::uint16_t> channels;
  for (const auto& [number, source] : sources_)
    channels.push_back(number);
  return channels;
}

void Marks::take(const recording::Message& message, std::uint64_t time_ns) {
  const auto found = sources_.find(message.channel_id);
  if (found == sources_.end()) return;
  const Source& source = found->second;
  switch (source.role) {
    case Role::kTrial:
      return take_trial(source, message.data, time_ns);
    case Role::kNote:
      return take_note(message.data, time_ns);
    case Role::kFault:
      return take_fault(source, message.data, time_ns);
    case Role::kStop:
      return take_stop(source, message.data, time_ns);
    case Role::kLease:
      return take_lease(source, message.data, time_ns);
  }
}

void Marks::take_trial(const Source& source, ConstBytes table, std::uint64_t time_ns) {
  // FlatBuffers must be read from aligned memory.
  const std::vector<std::byte> aligned(table.begin(), table.end());
  if (!rpc::is_valid_table<Trial>(aligned, TrialEvent::kLimits)) return;
  const Trial& trial = *flatbuffers::GetRoot<Trial>(aligned.data());
  const std::pair key{source.event_source, trial.number()};
  Span span{.begin_ns = time_ns,
            .number = trial.number(),
            .condition = shown(trial.condition()),
            .response = shown(trial.response())};
  if (trial.phase() == TrialPhase::Begin) {
    if (open_trials_.size() >= kOpenCountMax) open_trials_.erase(open_trials_.begin());
    open_trials_.insert_or_assign(key, std::move(span));
  } else if (trial.phase() == TrialPhase::End) {
    const auto begun = open_trials_.find(key);
    span.end_ns = time_ns;
    if (const auto duration = trial.duration_ns()) {
      span.begin_ns = time_ns - std::min<std::uint64_t>(*duration, time_ns);
    } else if (begun != open_trials_.end()) {
      span.begin_ns = begun->second.begin_ns;
    }
    if (begun != open_trials_.end()) open_trials_.erase(begun);
    trials_.add(std::move(span));
  } else {
    std::string label = shown(trial.note());
    for (const std::string& part : {span.response, span.condition}) {
      if (label.empty()) label = part;
    }
    if (trial.number() != 0) label += " (" + std::to_string(trial.number()) + ")";
    markers_.add({time_ns, std::move(label)});
  }
}

void Marks::take_note(ConstBytes json, std::uint64_t time_ns) {
  const std::string_view text(reinterpret_cast<const char*>(json.data()), json.size());
  const auto note = parse_bounded_json<nlohmann::json>(std::string(text));
  if (!note.is_object()) return;
  const auto label = note.find("text");
  if (label == note.end() || !label->is_string()) return;
  markers_.add({time_ns, shown(label->get_ref<const std::string&>())});
}

void Marks::take_fault(const Source& source, ConstBytes table, std::uint64_t time_ns) {
  const auto change = struct_of<device::FaultChange>(table);
  if (!change) return;
  for (unsigned bit = 0; bit < 32; ++bit) {
    const driver::Faults fault(1u << bit);
    // StopChanged reports it, too.
    if (fault.has(driver::Fault::kEmergencyStop)) continue;
    const bool is_lost = fault.has(driver::Fault::kDeviceGone);
    if ((change->ended() >> bit & 1u) != 0) end({source.device, bit}, time_ns);
    if ((change->begun() >> bit & 1u) != 0) {
      begin({source.device, bit}, {.begin_ns = time_ns,
                                   .kind = is_lost ? "lost" : "fault",
                                   .device = source.device,
                                   .what = driver::to_text(fault)});
    }
  }
}

void Marks::take_stop(const Source& source, ConstBytes table, std::uint64_t time_ns) {
  const auto change = struct_of<device::StopChange>(table);
  if (!change) return;
  if (!change->is_stopped()) return end({source.device, kStopBit}, time_ns);
  begin({source.device, kStopBit},
        {.begin_ns = time_ns, .kind = "stop", .device = source.device, .what = "emergency stop"});
}

void Marks::take_lease(const Source& source, ConstBytes table, std::uint64_t time_ns) {
  const auto change = struct_of<device::LeaseChange>(table);
  if (!change || change->state() >= gvd::kLeaseStateCount) return;
  incidents_.add(
      {.begin_ns = time_ns,
       .kind = "lease",
       .device = source.device,
       .what = std::string(gvd::to_string(static_cast<gvd::LeaseState>(change->state())))});
}

void Marks::begin(const Open& open, Incident incident) {
  if (open_incidents_.size() >= kOpenCountMax) open_incidents_.erase(open_incidents_.begin());
  open_incidents_.try_emplace(open, std::move(incident));
}

void Marks::end(const Open& open, std::uint64_t time_ns) {
  const auto found = open_incidents_.find(open);
  if (found == open_incidents_.end()) return;
  found->second.end_ns = time_ns;
  incidents_.add(std::move(found->second));
  open_incidents_.erase(found);
}

nlohmann::ordered_json Marks::json() const {
  OrderedJson markers = OrderedJson::array();
  for (const Marker& each : markers_.kept())
    markers.push_back({{"time_ns", each.time_ns}, {"label", each.label}});
  OrderedJson trials = OrderedJson::array();
  const auto add_trial = [&trials](const Span& each) {
    trials.push_back({{"begin_ns", each.begin_ns},
                      {"end_ns", time_or_null(each.end_ns)},
                      {"number", each.number},
                      {"condition", each.condition},
                      {"response", each.response}});
  };
  std::ranges::for_each(trials_.kept(), add_trial);
  for (const auto& [key, each] : open_trials_)
    add_trial(each);
  OrderedJson incidents = OrderedJson::array();
  const auto add_incident = [&incidents](const Incident& each) {
    incidents.push_back({{"begin_ns", each.begin_ns},
                         {"end_ns", time_or_null(each.end_ns)},
                         {"kind", each.kind},
                         {"device", each.device},
                         {"what", each.what}});
  };
  std::ranges::for_each(incidents_.kept(), add_incident);
  for (const auto& [key, each] : open_incidents_)
    add_incident(each);
  return {{"markers", std::move(markers)},
          {"marker_count", markers_.count()},
          {"trials", std::move(trials)},
          {"trial_count", trials_.count() + open_trials_.size()},
          {"incidents", std::move(incidents)},
          {"incident_count", incidents_.count() + open_incidents_.size()}};
}

}  // namespace rtpm::console
