#include "live/device_state.hpp"

#include <algorithm>
#include <array>
#include <utility>

namespace rtpm::console {
namespace {

using Json = nlohmann::ordered_json;

constexpr Duration kRateSpan = std::chrono::seconds{1};
constexpr Duration kStaleAge = std::chrono::seconds{1};

double seconds_of(Duration time) {
  return std::chrono::duration<double>(time).count();
}

Json array_of(const driver::Vector3& vector) {
  return {vector.x, vector.y, vector.z};
}

Json faults_of(driver::Faults faults) {
  Json list = Json::array();
  for (unsigned bit = 0; bit < 32; ++bit) {
    const driver::Faults one(faults.bits() & 1u << bit);
    if (!one.empty()) list.push_back(driver::to_text(one));
  }
  return list;
}

void add_channels(Json& json, const driver::Descriptor& descriptor) {
  Json axes = Json::array();
  for (const driver::Axis& axis : descriptor.axes) {
    axes.push_back(
        {{"name", axis.name}, {"is_sensed", axis.is_sensed}, {"is_actuated", axis.is_actuated}});
  }
  Json analogs = Json::array();
  for (const driver::Analog& analog : descriptor.analogs) {
    analogs.push_back(
        {{"name", analog.name}, {"unit", analog.unit}, {"low", analog.low}, {"high", analog.high}});
  }
  Json joints = Json::array();
  for (const driver::Joint& joint : descriptor.joints) {
    joints.push_back({{"name", joint.name},
                      {"unit", joint.unit},
                      {"low", joint.low},
                      {"high", joint.high},
                      {"velocity_max", joint.velocity_max},
                      {"effort_max", joint.effort_max}});
  }
  Json outputs = Json::array();
  for (const driver::Output& output : descriptor.outputs) {
    outputs.push_back({{"name", output.name},
                       {"unit", output.unit},
                       {"low", output.low},
                       {"high", output.high},
                       {"safe", output.safe}});
  }
  json["axes"] = std::move(axes);
  json["buttons"] = descriptor.buttons;
  json["analogs"] = std::move(analogs);
  json["joints"] = std::move(joints);
  json["outputs"] = std::move(outputs);
}

}  // namespace

void DeviceState::take(const DeviceProbe& probe, MonotonicTime now) {
  problem_ = probe.problem;
  if (probe.link) link_ = probe.link;
  if (probe.descriptor) descriptor_ = probe.descriptor;
  if (!probe.url.empty()) url_ = probe.url;
  if (probe.holder) {
    holder_ = *probe.holder;
    held_since_.reset();
    if (holder_->held_for > Duration{0}) held_since_ = now - holder_->held_for;
  }
  if (probe.latency) {
    latency_.record(now, *probe.latency);
  } else {
    latency_.record_failure(now);
  }
  if (!probe.sample) return;
  sample_ = probe.sample;
  see_sequence(probe.sample->sequence, now);
}

void DeviceState::take_sample(std::uint64_t sequence, MonotonicTime now) {
  see_sequence(sequence, now);
}

void DeviceState::take_lease(gvd::LeaseState state, MonotonicTime since) {
  lease_ = state;
  lease_since_ = since;
}

void DeviceState::set_bound(const std::string& service_url) {
  service_url_ = service_url;
  if (!std::exchange(lost_since_, std::nullopt)) return;
  problem_ = "not asked yet";
}

void DeviceState::set_lost(MonotonicTime since, const std::string& url) {
  if (lost_since_) return;
  lost_since_ = since;
  if (url_.empty()) url_ = url;
  problem_ = "its name has expired: its server hangs, is dead, or is cut off";
}

void DeviceState::see_sequence(std::uint64_t sequence, MonotonicTime now) {
  // A restarted server counts from one again; a late event is only slightly older.
  constexpr std::uint64_t kLateMax = 1000;
  const bool is_restart = sequence + kLateMax < sequence_;
  if (sequence <= sequence_ && !is_restart) return;
  sequence_ = sequence;
  newest_ = now;
  if (!rate_begin_ || is_restart) {
    rate_begin_ = now;
    rate_sequence_ = sequence;
  } else if (now - *rate_begin_ >= kRateSpan) {
    sample_per_s_ = static_cast<double>(sequence - rate_sequence_) / seconds_of(now - *rate_begin_);
    rate_begin_ = now;
    rate_sequence_ = sequence;
  }
}

Json DeviceState::lease_json(MonotonicTime now, std::optional<Duration> lease_left) const {
  const bool is_own = link_ && link_->lease() != 0;
  const bool is_named = holder_ && holder_->is_held;
  std::string lease = "free";
  std::optional<MonotonicTime> since = lease_since_;
  if (lease_ == gvd::LeaseState::kHeld) lease = "held";
  // Before the first event, and without a hub, the device's server knows.
  if (lease_ == gvd::LeaseState::kUnknown) {
    lease = is_named ? "held" : holder_ ? "free" : "unknown";
    since = held_since_;
  }
  if (is_own) lease = "held by this console";
  return {{"state", lease},
          {"holder", lease == "held" && is_named ? holder_->name : ""},
          {"since_s", since ? Json(seconds_of(now - *since)) : Json()},
          {"ends_in_s", is_own && lease_left ? Json(seconds_of(*lease_left)) : Json()}};
}

Json DeviceState::json(MonotonicTime now, bool has_config,
                       std::optional<Duration> lease_left) const {
  const bool is_fresh = newest_ && now - *newest_ <= kStaleAge;
  Json json{{"name", name_},
            {"model", descriptor_ ? descriptor_->model : ""},
            {"serial", descriptor_ ? descriptor_->serial : ""},
            {"class", descriptor_ ? driver::to_string(descriptor_->device_class) : ""},
            {"url", url_},
            {"ok", problem_.empty() && is_fresh},
            {"lost_for_s", lost_since_ ? Json(seconds_of(now - *lost_since_)) : Json()}};
  json["problem"] =
      problem_.empty() && newest_ && !is_fresh ? "no new sample for over a second" : problem_;
  json["age_ms"] = newest_ ? Json(seconds_of(now - *newest_) * 1000) : Json();
  json["lifecycle"] = sample_ ? driver::to_string(sample_->lifecycle) : "unconfigured";
  json["faults"] = sample_ ? faults_of(sample_->faults) : Json::array();
  json["success_rate"] = sample_ ? sample_->success_rate : 0.0F;
  json["sample_per_s"] = is_fresh ? sample_per_s_ : 0;
  if (descriptor_) {
    json["force_newton_max"] = descriptor_->limits.force_newton_max;
    json["workspace_low_m"] = array_of(descriptor_->workspace.low_m);
    json["workspace_high_m"] = array_of(descriptor_->workspace.high_m);
    add_channels(json, *descriptor_);
    json["rate_hz"] = descriptor_->rate_hz;
  }
  json["lease"] = lease_json(now, lease_left);
  json["is_stopped"] = sample_ && sample_->faults.has(driver::Fault::kEmergencyStop);
  json["has_config"] = has_config;
  return json;
}

}  // namespace rtpm::console
