#include "recording/hub_recording.hpp"

#include <utility>

#include "rtpm/rt/clock.hpp"

namespace rtpm::console {
namespace {

constexpr Duration kHubDeadline = std::chrono::milliseconds{500};

}  // namespace

expected<std::unique_ptr<HubRecording>, SetupError> HubRecording::create(rpc::Node& node,
                                                                         const std::string& hub,
                                                                         const std::string& path) {
  auto types = events::HubTypes::ask(node, hub, kHubDeadline);
  if (!types) return unexpected{types.error()};
  auto recorder = recording::Recorder::create(path);
  if (!recorder) return unexpected{recorder.error()};
  std::unique_ptr<HubRecording> created(
      new HubRecording(node, hub, std::move(*types), std::move(*recorder)));
  events::ConsumerConfig config{.name = "record"};
  config.delivery.queue_capacity = events::kQueueCapacityMax;
  config.realtime = rt::RealtimeMode::kOff;
  config.has_own_thread = true;
  config.deadline = kHubDeadline;
  auto consumer = events::Consumer::create(node, hub, std::move(config), *created);
  if (!consumer) return unexpected{consumer.error()};
  created->consumer_ = std::move(*consumer);
  return created;
}

HubRecording::HubRecording(rpc::Node& node, std::string hub, events::HubTypes types,
                           std::unique_ptr<recording::Recorder> recorder)
    : node_(node),
      hub_(std::move(hub)),
      begin_(rt::now()),
      recorder_(std::move(recorder)),
      types_(std::move(types)),
      events_(*recorder_) {}

HubRecording::~HubRecording() {
  consumer_.reset();  // It calls until then.
}

void HubRecording::on_events(std::span<const events::EventView> events) {
  const std::lock_guard lock(mutex_);
  for (const events::EventView& event : events) {
    const events::EventDescriptor* const type = types_.find(event.header.type);
    lacks_type_ = lacks_type_ || (type == nullptr && event.header.type <= events::kEventTypeMax);
    events_.record(event, type);
  }
}

void HubRecording::care() {
  {
    const std::lock_guard lock(mutex_);
    if (!std::exchange(lacks_type_, false)) return;
  }
  auto types = events::HubTypes::ask(node_, hub_, kHubDeadline);
  if (!types) return;
  const std::lock_guard lock(mutex_);
  types_ = std::move(*types);
}

HubRecording::Status HubRecording::status() const {
  Status status{.time_s = std::chrono::duration<double>(rt::now() - begin_).count(),
                .recorder = recorder_->status()};
  if (consumer_) {
    const events::Losses losses = consumer_->counters().losses;
    status.lost_count = losses.total() - losses.suspended_count;
  }
  return status;
}

expected<void, SetupError> HubRecording::close() {
  consumer_->unsubscribe();
  return recorder_->close();
}

}  // namespace rtpm::console
