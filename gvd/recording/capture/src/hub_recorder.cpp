#include "rtpm/capture/hub_recorder.hpp"

#include <device.rtpm.hpp>
#include <mutex>
#include <span>
#include <utility>

#include "event_recorder.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/capture/device_recorder.hpp"
#include "rtpm/capture/parameters.hpp"
#include "rtpm/events/hub_types.hpp"
#include "rtpm/names/directory.hpp"
#include "rtpm/rt/pi_mutex.hpp"

namespace rtpm::capture {

struct HubRecorder::Impl final : events::EventHandler {
  Impl(rpc::Node& given_node, recording::Recorder& recorder, HubRecorderConfig given,
       events::HubTypes hub_types)
      : node(given_node),
        config(std::move(given)),
        device_recorder(node, recorder),
        types(std::move(hub_types)),
        event_recorder(recorder, /*names_devices=*/true) {}

  expected<void, SetupError> subscribe() {
    if (const auto named = name_devices(); !named) {  // Before their first events arrive.
      reports.push_back("devices are recorded by number, not by name, and can't be played: " +
                        named.error().text());
    }
    events::ConsumerConfig wanted{.name = "record", .filter = config.filter};
    wanted.delivery.every_nth = config.every_nth;
    wanted.delivery.queue_capacity = events::kQueueCapacityMax;
    wanted.realtime = rt::RealtimeMode::kOff;
    wanted.has_own_thread = true;
    wanted.priority = config.priority;
    wanted.deadline = config.deadline;
    const std::lock_guard lock(mutex);  // The first events wait until `consumer` is set.
    auto joined = events::Consumer::create(node, config.hub, std::move(wanted), *this);
    if (!joined) return unexpected{joined.error()};
    consumer = std::move(*joined);
    return {};
  }

  void on_events(std::span<const events::EventView> given) override {
    const std::lock_guard lock(mutex);
    // The ring is on the hub's host.
    const bool is_hub_local = consumer->reads_ring();
    for (const events::EventView& event : given) {
      const events::EventDescriptor* const type = types.find(event.header.type);
      lacks_type = lacks_type || (type == nullptr && event.header.type <= events::kEventTypeMax);
      event_recorder.record(event, type, is_hub_local);
    }
    take_new_devices();
  }
  void on_notice(const events::Notice& notice) override {
    std::string text = text_of(notice, config.hub);
    const std::lock_guard lock(mutex);
    if (!text.empty() && !is_ending) reports.push_back(std::move(text));
  }

  void attend() {
    bool asks = false;
    {
      const std::lock_guard lock(mutex);
      asks = std::exchange(lacks_type, false) || event_recorder.is_holding();
    }
    if (event_recorder.take_new_unnamed()) static_cast<void>(name_devices());
    if (asks) learn_types();
    {
      const std::lock_guard lock(mutex);
      event_recorder.attend(types.list());
    }
    describe_devices();
  }
  void learn_types() {
    auto asked = events::HubTypes::ask(node, config.hub, config.deadline);
    const std::lock_guard lock(mutex);
    if (asked) types = std::move(*asked);
  }
  expected<void, SetupError> name_devices() {
    const auto entries = names::Directory(node, config.registry).list();
    if (!entries) return unexpected{SetupError{entries.error()}};
    std::vector<std::string> found;
    for (const names::NameEntry& entry : *entries) {
      if (entry.interface == device::DeviceClient::interface().name) found.push_back(entry.name);
    }
    event_recorder.name_devices(found);
    return {};
  }
  /// Their parameters are read at once, as they may change soon. The mutex must be locked.
  void take_new_devices() {
    for (std::string& name : event_recorder.take_new_devices()) {
      if (config.parameters != nullptr) config.parameters->add(name);
      new_devices.push_back(std::move(name));
    }
  }
  void describe_devices() {
    std::vector<std::string> names;
    {
      const std::lock_guard lock(mutex);
      take_new_devices();
      names = std::exchange(new_devices, {});
    }
    for (const std::string& name : names) {
      const auto described = device_recorder.describe(name);
      if (described) {
        event_recorder.add_view(name, *described);
        continue;
      }
      const std::lock_guard lock(mutex);
      undescribed.push_back(name);
      reports.push_back(printable(name) + ": " + described.error().text() +
                        "; without its description it can't be played");
    }
  }

  void finish() {
    attend();
    {
      const std::lock_guard lock(mutex);
      is_ending = true;
    }
    consumer->unsubscribe();
    {
      const std::lock_guard lock(mutex);
      event_recorder.finish(types.list());
    }
    describe_devices();
  }

  rpc::Node& node;
  HubRecorderConfig config;
  DeviceRecorder device_recorder;
  mutable rt::PiMutex mutex{};
  events::HubTypes types;        ///< Guarded by `mutex`, like the members up to `reports`.
  EventRecorder event_recorder;  ///< The mutex guards record(), attend() and finish().
  bool lacks_type = false;
  bool is_ending = false;                  ///< This object is ending the subscription.
  std::vector<std::string> new_devices{};  ///< Not described yet.
  std::vector<std::string> undescribed{};
  std::vector<std::string> reports{};
  std::unique_ptr<events::Consumer> consumer{};  ///< Set under the mutex.
};

expected<std::unique_ptr<HubRecorder>, SetupError> HubRecorder::create(
    rpc::Node& node, recording::Recorder& recorder, events::HubTypes types,
    const HubRecorderConfig& config) {
  auto impl = std::make_unique<Impl>(node, recorder, config, std::move(types));
  if (auto joined = impl->subscribe(); !joined) return unexpected{joined.error()};
  return std::unique_ptr<HubRecorder>(new HubRecorder(std::move(impl)));
}

HubRecorder::HubRecorder(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
HubRecorder::~HubRecorder() = default;

void HubRecorder::attend() {
  impl_->attend();
}

void HubRecorder::finish() {
  impl_->finish();
}

std::uint64_t HubRecorder::lost_count() const {
  const events::Losses losses = impl_->consumer->counters().losses;
  return losses.total() - losses.suspended_count;
}

std::vector<std::string> HubRecorder::take_reports() {
  const std::lock_guard lock(impl_->mutex);
  return std::exchange(impl_->reports, {});
}

std::vector<std::string> HubRecorder::undescribed_devices() const {
  const std::lock_guard lock(impl_->mutex);
  return impl_->undescribed;
}

std::string text_of(const events::Notice& notice, const std::string& hub) {
  switch (notice.kind) {
    case events::NoticeKind::kSubscribed:
      return "";
    case events::NoticeKind::kLosses:
      return "events were lost: this reader was too slow";
    case events::NoticeKind::kResubscribed:
      return hub + ": subscribed again, events of the time between are lost";
    default:
      return hub + ": " + std::string(notice.text);
  }
}

}  // namespace rtpm::capture
