#include "rtpm/capture/live_recording.hpp"

#include <device.rtpm.hpp>
#include <mutex>
#include <span>
#include <utility>
#include <vector>

#include "rtpm/capture/annotations.hpp"
#include "rtpm/capture/device_recorder.hpp"
#include "rtpm/capture/event_recorder.hpp"
#include "rtpm/events/consumer.hpp"
#include "rtpm/events/hub_types.hpp"
#include "rtpm/names/directory.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/pi_mutex.hpp"
#include "rtpm/rt/semaphore.hpp"
#include "rtpm/rt/thread.hpp"

namespace rtpm::capture {
namespace {

/// Interval at which the hub is asked for unknown types and names.
constexpr Duration kPeriod = std::chrono::milliseconds{200};

}  // namespace

struct LiveRecording::Impl final : events::EventHandler {
  Impl(rpc::Node& given_node, LiveRecordingConfig given, events::HubTypes hub_types,
       std::unique_ptr<recording::Recorder> opened)
      : node(given_node),
        config(std::move(given)),
        begin(rt::now()),
        recorder(std::move(opened)),
        device_recorder(node, *recorder),
        types(std::move(hub_types)),
        event_recorder(*recorder, /*names_devices=*/true) {}
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;
  ~Impl() override { static_cast<void>(stop()); }

  expected<void, SetupError> start() {
    auto made = Annotations::create(*recorder);
    if (!made) return unexpected{made.error()};
    annotations = std::move(*made);
    name_devices();  // Before their first events come.
    events::ConsumerConfig wanted{.name = "record"};
    wanted.delivery.queue_capacity = events::kQueueCapacityMax;
    wanted.realtime = rt::RealtimeMode::kOff;
    wanted.has_own_thread = true;
    wanted.deadline = config.deadline;
    auto joined = events::Consumer::create(node, config.hub, std::move(wanted), *this);
    if (!joined) return unexpected{joined.error()};
    consumer = std::move(*joined);
    auto begun = rt::Thread::start({.name = "rtpm-record", .realtime = rt::RealtimeMode::kOff},
                                   [this] { run(); });
    if (!begun) return unexpected{begun.error()};
    thread = std::move(*begun);
    return {};
  }

  void on_events(std::span<const events::EventView> given) override {
    const std::lock_guard lock(mutex);
    for (const events::EventView& event : given) {
      const events::EventDescriptor* const type = types.find(event.header.type);
      lacks_type = lacks_type || (type == nullptr && event.header.type <= events::kEventTypeMax);
      event_recorder.record(event, type);
    }
  }

  void run() {
    while (!ending.wait_until(rt::now() + kPeriod))
      attend();
  }
  void attend() {
    bool asks = false;
    {
      const std::lock_guard lock(mutex);
      asks = std::exchange(lacks_type, false) || event_recorder.is_holding();
    }
    if (event_recorder.take_new_unnamed()) name_devices();
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
  void name_devices() {
    const auto entries = names::Directory(node, config.registry).list();
    if (!entries) return;
    std::vector<std::string> found;
    for (const names::NameEntry& entry : *entries) {
      if (entry.interface == device::DeviceClient::interface().name) found.push_back(entry.name);
    }
    event_recorder.name_devices(found);
  }
  void describe_devices() {
    for (const std::string& name : event_recorder.take_new_devices()) {
      if (device_recorder.describe(name)) continue;
      const std::lock_guard lock(mutex);
      undescribed_devices.push_back(name);
    }
  }

  expected<void, SetupError> stop() {
    if (thread.is_running()) {
      ending.post();
      thread.join();
      attend();
    }
    if (consumer && !std::exchange(is_stopped, true)) {
      consumer->unsubscribe();
      const std::lock_guard lock(mutex);
      event_recorder.finish(types.list());
    }
    describe_devices();
    return recorder->close();
  }

  [[nodiscard]] LiveRecordingStatus status() const {
    LiveRecordingStatus status{.time = rt::now() - begin, .recorder = recorder->status()};
    if (consumer) {
      const events::Losses losses = consumer->counters().losses;
      status.lost_count = losses.total() - losses.suspended_count;
    }
    const std::lock_guard lock(mutex);
    status.undescribed_devices = undescribed_devices;
    return status;
  }

  rpc::Node& node;
  LiveRecordingConfig config;
  MonotonicTime begin;
  std::unique_ptr<recording::Recorder> recorder;
  DeviceRecorder device_recorder;
  std::unique_ptr<Annotations> annotations{};
  mutable rt::PiMutex mutex{};
  events::HubTypes types;        ///< Guarded by `mutex`, as
  EventRecorder event_recorder;  ///< what is recorded,
  bool lacks_type = false;       ///< and these.
  std::vector<std::string> undescribed_devices{};
  bool is_stopped = false;
  std::unique_ptr<events::Consumer> consumer{};
  rt::Semaphore ending{};
  rt::Thread thread{};
};

expected<std::unique_ptr<LiveRecording>, SetupError> LiveRecording::start(
    rpc::Node& node, const std::string& file, LiveRecordingConfig config) {
  auto types = events::HubTypes::ask(node, config.hub, config.deadline);
  if (!types) return unexpected{types.error()};
  auto recorder = recording::Recorder::create(file, config.recorder);
  if (!recorder) return unexpected{recorder.error()};
  auto impl =
      std::make_unique<Impl>(node, std::move(config), std::move(*types), std::move(*recorder));
  if (auto started = impl->start(); !started) return unexpected{started.error()};
  return std::unique_ptr<LiveRecording>(new LiveRecording(std::move(impl)));
}

LiveRecording::LiveRecording(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
LiveRecording::~LiveRecording() = default;

bool LiveRecording::annotate(std::string_view text) {
  return impl_->annotations->annotate(text);
}

recording::Recorder& LiveRecording::recorder() noexcept {
  return *impl_->recorder;
}

LiveRecordingStatus LiveRecording::status() const {
  return impl_->status();
}

expected<void, SetupError> LiveRecording::stop() {
  return impl_->stop();
}

}  // namespace rtpm::capture
