#include "device_topics.hpp"

#include <algorithm>
#include <utility>
#include <variant>

#include "description_text.hpp"
#include "rtpm/ros2/message.hpp"
#include "rtpm/ros2/names.hpp"
#include "rtpm/rt/utc.hpp"

namespace rtpm::ros2 {
namespace {

/// Presses and releases that may wait for the publishing thread.
constexpr std::size_t kEdgeCountMax = 64;
/// After this time without a sample the status says so.
constexpr Duration kSilentAfter = std::chrono::seconds{1};

/// The offset between the clocks is measured each time, because CLOCK_REALTIME is steered and set.
Time stamp_of(MonotonicTime time) {
  return time_of(static_cast<std::int64_t>(rt::utc_ns(time)));
}

constexpr Quality kStream{};
constexpr Quality kLatched{.is_latched = true, .depth = 1};

}  // namespace

expected<std::unique_ptr<DeviceTopics>, SetupError> DeviceTopics::create(
    Participant& participant, std::string name, const driver::Descriptor& descriptor,
    Publisher* tf) {
  std::unique_ptr<DeviceTopics> topics(new DeviceTopics(std::move(name), descriptor, tf));
  if (auto opened = topics->open(participant); !opened) return unexpected{opened.error()};
  return topics;
}

expected<void, SetupError> DeviceTopics::open(Participant& participant) {
  const Subjects subjects = subjects_of(descriptor_);
  std::optional<SetupError> problem;
  const auto add = [&]<class M>(std::unique_ptr<Publisher>& publisher, std::string_view subject,
                                const M&, const Quality& quality, bool is_wanted) {
    if (!is_wanted || problem) return;
    auto made = participant.publish(
        {topic_name(name_, subject), std::string(M::kType), type_hash<M>()}, quality);
    if (made) {
      publisher = std::move(*made);
    } else {
      problem = made.error();
    }
  };
  add(pose_, kPoseTopic, PoseStamped{}, kStream, subjects.has_pose);
  add(twist_, kTwistTopic, TwistStamped{}, kStream, subjects.has_pose);
  add(wrench_, kWrenchTopic, WrenchStamped{}, kStream, subjects.has_wrench);
  add(joints_, kJointsTopic, JointState{}, kStream, subjects.has_joints);
  add(joy_, kJoyTopic, Joy{}, kStream, subjects.has_joy);
  add(imu_, kImuTopic, Imu{}, kStream, subjects.has_imu);
  add(stopped_, "stopped", Bool{}, kLatched, true);
  add(description_, "description", String{}, kLatched, true);
  if (problem) return unexpected{*problem};
  send(description_, String{.data = description_text(name_, descriptor_)});
  return {};
}

// ---- the consumers' threads ---------------------------------------------------------------------

void DeviceTopics::take(const gvd::DeviceEvent& event) {
  const std::lock_guard lock(mutex_);
  if (const auto* const sample = std::get_if<driver::Sample>(&event.what)) {
    take_sample(*sample, event.header);
  } else if (const auto* const button = std::get_if<gvd::ButtonChange>(&event.what)) {
    take_edge(*button, event.header.origin);
  } else if (const auto* const faults = std::get_if<gvd::FaultChange>(&event.what)) {
    faults_.set(faults->begun);
    is_changed_ = true;
  } else if (const auto* const stop = std::get_if<gvd::StopChange>(&event.what)) {
    is_stopped_ = stop->is_stopped;
    is_changed_ = true;
  } else if (const auto* const lease = std::get_if<gvd::LeaseChange>(&event.what)) {
    lease_ = lease->state;
    is_changed_ = true;
  } else if (std::holds_alternative<gvd::LifecycleChange>(event.what)) {
    is_changed_ = true;
  }
}

void DeviceTopics::take_sample(const driver::Sample& sample, const events::EventHeader& header) {
  if (waiting_) ++counters_.replaced_count;
  // The next edge toggles a button of this sample, unless an edge is already newer.
  if (edges_.empty() || edges_.back().origin <= header.origin) buttons_ = sample.buttons;
  waiting_ = {sample, header.origin};
  faults_.set(sample.faults);
  is_stopped_ = sample.faults.has(driver::Fault::kEmergencyStop);
  newest_ = header.origin;
  uncertainty_ns_ = header.origin_uncertainty_ns;
}

void DeviceTopics::take_edge(const gvd::ButtonChange& change, MonotonicTime origin) {
  if (change.button >= driver::kButtonCountMax) return;
  const std::uint32_t bit = 1U << change.button;
  buttons_ = change.is_pressed ? buttons_ | bit : buttons_ & ~bit;
  if (edges_.size() == kEdgeCountMax) {
    ++counters_.lost_edge_count;
    return;
  }
  edges_.push_back({buttons_, origin});
}

// ---- the publishing thread ----------------------------------------------------------------------

void DeviceTopics::publish() {
  std::optional<Sampled> newest;
  std::vector<Edge> edges;
  std::optional<bool> is_stopped;
  {
    const std::lock_guard lock(mutex_);
    newest = std::exchange(waiting_, std::nullopt);
    edges.swap(edges_);
    is_stopped = is_stopped_;
  }
  for (const Edge& edge : edges)
    publish_edge(edge);
  if (newest) publish_sample(*newest);
  if (is_stopped && is_stopped != shown_stop_) publish_stop(*is_stopped);
}

void DeviceTopics::publish_edge(const Edge& edge) {
  // Before the first sample there are no values for the axes.
  if (!joy_ || shown_.sequence == 0) return;
  driver::Sample sample = shown_;
  sample.buttons = edge.buttons;
  joy_time_ = std::max(joy_time_, edge.origin);
  send(joy_, joy_of(descriptor_, sample, stamp_of(joy_time_)));
}

void DeviceTopics::publish_sample(const Sampled& newest) {
  const driver::Sample& sample = newest.sample;
  const Time stamp = stamp_of(newest.origin);
  if (pose_) send(pose_, pose_of(descriptor_, sample, stamp));
  if (twist_) send(twist_, twist_of(descriptor_, sample, stamp));
  if (wrench_) send(wrench_, applied_wrench_of(descriptor_, sample, stamp));
  if (joints_) send(joints_, joint_state_of(descriptor_, sample, stamp));
  if (imu_) send(imu_, imu_of(descriptor_, sample, stamp));
  // Edges come by another subscription, and may be newer than the sample.
  if (joy_ && newest.origin >= joy_time_) {
    joy_time_ = newest.origin;
    send(joy_, joy_of(descriptor_, sample, stamp));
  }
  if (tf_ != nullptr && pose_) {
    encode(TfMessage{.transforms = {transform_of(descriptor_, sample, stamp, ros_name(name_))}},
           bytes_);
    count(tf_->publish(bytes_));
  }
  shown_ = sample;
}

void DeviceTopics::publish_stop(bool is_stopped) {
  send(stopped_, Bool{.data = is_stopped});
  shown_stop_ = is_stopped;
}

template <class Message>
void DeviceTopics::send(const std::unique_ptr<Publisher>& publisher, const Message& message) {
  encode(message, bytes_);
  count(publisher->publish(bytes_));
}

void DeviceTopics::count(bool is_sent) {
  const std::lock_guard lock(mutex_);
  ++(is_sent ? counters_.published_count : counters_.failed_count);
}

bool DeviceTopics::is_changed() {
  const std::lock_guard lock(mutex_);
  return is_changed_;
}

DiagnosticStatus DeviceTopics::status(MonotonicTime now) {
  const std::lock_guard lock(mutex_);
  driver::Sample sample = waiting_ ? waiting_->sample : shown_;
  sample.faults.set(std::exchange(faults_, driver::Faults{}));
  is_changed_ = false;
  DiagnosticStatus status = status_of(name_, descriptor_, sample);
  if (!newest_ || now - *newest_ > kSilentAfter) {
    status.level = DiagnosticStatus::kStale;
    status.message = newest_ ? "no sample for more than a second"
                             : "no sample yet: does its server push events to the hub?";
  }
  const auto add = [&status](const char* key, std::string value) {
    status.values.push_back({key, std::move(value)});
  };
  add("lease", std::string(gvd::to_string(lease_)));
  add("stamp uncertainty ns",
      uncertainty_ns_ == events::kUncertaintyUnknown ? "unknown" : std::to_string(uncertainty_ns_));
  add("messages not sent", std::to_string(counters_.failed_count));
  add("samples replaced", std::to_string(counters_.replaced_count));
  add("button edges lost", std::to_string(counters_.lost_edge_count));
  return status;
}

DeviceTopicsCounters DeviceTopics::counters() const {
  const std::lock_guard lock(mutex_);
  return counters_;
}

}  // namespace rtpm::ros2
