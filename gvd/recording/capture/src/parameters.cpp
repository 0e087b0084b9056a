#include "rtpm/capture/parameters.hpp"

#include <algorithm>
#include <configuration.rtpm.hpp>
#include <map>
#include <mutex>
#include <optional>
#include <span>
#include <utility>

#include "flatbuffer_channel.hpp"
#include "rtpm/base/assert.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/capture/channels.hpp"
#include "rtpm/configuration/list_reply.hpp"
#include "rtpm/events/consumer.hpp"
#include "rtpm/gvd/device_event.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/pi_mutex.hpp"
#include "rtpm/rt/semaphore.hpp"
#include "rtpm/rt/thread.hpp"

namespace rtpm::capture {
namespace {

using Stub = configuration::ConfigurationClient;

constexpr Duration kPollPeriod = std::chrono::seconds{2};
/// The pause after failures of a device; doubled with each one.
constexpr Duration kPauseMax = std::chrono::seconds{30};
/// How long stop() waits for devices that were not read yet.
constexpr Duration kEndMax = std::chrono::seconds{1};
/// Devices with a reported change; the others are found within kPollPeriod.
constexpr std::size_t kChangedMax = 4096;
constexpr const char* kLeaf = "parameters";

expected<std::uint16_t, SetupError> add_parameters_channel(recording::Recorder& recorder,
                                                           const std::string& device) {
  const rpc::InterfaceDescriptor& interface = Stub::interface();
  std::string error;
  const auto dynamic = schema::Dynamic::make(std::string(interface.schema), interface.name, error);
  RTPM_ASSERT(dynamic != nullptr, "generated code has a schema that can be read");
  return add_flatbuffer_channel(recorder, *dynamic, "rtpm.configuration.ListReply",
                                device + "/" + kLeaf,
                                {{kKindKey, kParametersKind},
                                 {kDeviceKey, device},
                                 {kSourceKey, std::to_string(gvd::source_of(device))},
                                 {kSchemaIdKey, std::to_string(interface.fingerprint)}});
}

struct Device {
  std::optional<Stub> stub{};
  std::optional<std::uint16_t> channel{};
  std::uint64_t revision = 0;  ///< The recorded one.
  std::uint32_t sequence = 0;  ///< The newest message has it.
  std::string parameter{};     ///< The name of one, to ask for the revision.
  std::string problem{};       ///< The newest failure; empty if there is none.
  bool has_none = false;       ///< The device serves no configuration.
  MonotonicTime next_attempt{};
  Duration pause = kPollPeriod;
};

}  // namespace

struct ParameterRecorder::Impl final : events::EventHandler {
  Impl(rpc::Node& given_node, recording::Recorder& given_recorder, ParameterRecorderConfig given)
      : node(given_node),
        recorder(given_recorder),
        track(given_recorder.add_track()),
        config(std::move(given)),
        added_names(config.devices) {}
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;
  ~Impl() override { stop(); }

  void on_events(std::span<const events::EventView> given) override {
    const MonotonicTime now = rt::now();
    const std::lock_guard lock(mutex);
    // The ring is on the hub's host: its clock is this one.
    const bool is_hub_local = consumer->reads_ring();
    for (const events::EventView& event : given) {
      const events::EventHeader& header = event.header;
      if (changed.size() >= kChangedMax) changed.clear();
      changed[header.source] =
          is_hub_local ? header.origin : now - (header.hub_sent - header.origin);
    }
    wake.post();
  }

  void run() {
    subscribe();
    do {
      take_added();
      for (auto& [name, device] : devices) {
        if (rt::now() >= end()) break;
        if (device.next_attempt <= rt::now()) look_at(name, device, std::nullopt);
      }
      const MonotonicTime next = rt::now() + kPollPeriod;
      while (end() == kNever && rt::now() < next && wake.wait_until(next)) {
        take_added();
        take_changes();
      }
    } while (end() == kNever);
    take_added();
    take_changes();
    write_missing();
  }
  void subscribe() {
    events::ConsumerConfig wanted{.name = kLeaf,
                                  .filter = events::of_type(gvd::kConfigurationChanged)};
    wanted.realtime = rt::RealtimeMode::kOff;
    wanted.has_own_thread = true;
    wanted.deadline = config.deadline;
    const std::lock_guard lock(mutex);  // The first events wait until `consumer` is set.
    auto joined = events::Consumer::create(node, config.hub, std::move(wanted), *this);
    if (joined) consumer = std::move(*joined);
  }
  void take_added() {
    std::vector<std::string> names;
    {
      const std::lock_guard lock(mutex);
      names = std::exchange(added_names, {});
    }
    for (const std::string& name : names) {
      const auto [device, is_new] = devices.try_emplace(name);
      if (is_new && rt::now() < end()) look_at(name, device->second, std::nullopt);
    }
  }
  void take_changes() {
    std::map<events::SourceId, MonotonicTime> taken;
    {
      const std::lock_guard lock(mutex);
      taken = std::exchange(changed, {});
    }
    if (taken.empty()) return;
    for (auto& [name, device] : devices) {
      if (const auto found = taken.find(gvd::source_of(name)); found != taken.end()) {
        look_at(name, device, found->second);
      }
    }
  }

  /// Records the parameters if they have changed.
  /// @param time  of the change; nullopt if it is not known
  void look_at(const std::string& name, Device& device, std::optional<MonotonicTime> time) {
    const auto looked = record_if_changed(name, device, time);
    const bool was_reported = !device.problem.empty();
    device.problem = looked ? std::string{} : looked.error().text();
    device.pause = looked ? kPollPeriod : std::min(2 * device.pause, kPauseMax);
    device.next_attempt = rt::now() + (looked ? Duration{0} : device.pause);
    if (looked) return;
    device.stub.reset();
    if (was_reported) return;
    const std::lock_guard lock(mutex);
    reports.push_back(printable(name) + ": its parameters were not recorded: " + device.problem);
  }
  expected<void, SetupError> record_if_changed(const std::string& name, Device& device,
                                               std::optional<MonotonicTime> time) {
    if (!device.stub) {
      auto bound = Stub::bind(node, gvd::configuration_path(name), {.deadline = config.deadline});
      device.has_none =
          !bound && bound.error().cause == make_error_code(rpc::CallError::kNoSuchObject);
      if (device.has_none) return {};
      if (!bound) return unexpected{bound.error()};
      device.stub.emplace(std::move(*bound));
    }
    if (!time && !device.parameter.empty()) {
      configuration::GetRequestT request;
      request.names = {device.parameter};
      const auto reply = device.stub->get(request, {.deadline = config.deadline});
      if (!reply) return setup_error("the configuration gave no answer", reply.error());
      if ((*reply)->revision() == device.revision) return {};
    }
    const auto reply = device.stub->list({}, {.deadline = config.deadline});
    if (!reply) return setup_error("the configuration gave no answer", reply.error());
    return record(name, device, **reply, reply->bytes(), time);
  }
  expected<void, SetupError> record(const std::string& name, Device& device,
                                    const configuration::ListReply& list, ConstBytes bytes,
                                    std::optional<MonotonicTime> time) {
    if (device.channel && list.revision() == device.revision) return {};
    if (!device.channel) {
      const auto added = add_parameters_channel(recorder, name);
      if (!added) return unexpected{added.error()};
      device.channel = *added;
    }
    const std::uint64_t now_ns = recorder.log_time_ns(rt::now());
    const bool is_put =
        track.put({.channel_id = *device.channel,
                   .sequence = ++device.sequence,
                   .log_time_ns = now_ns,
                   .publish_time_ns = time ? std::min(recorder.log_time_ns(*time), now_ns) : now_ns,
                   .data = bytes});
    if (!is_put) return setup_error("the recorder is full, or they take more than a message may");
    device.revision = list.revision();
    if (list.parameters()->size() > 0) {
      device.parameter = list.parameters()->Get(0)->name()->str();
    }
    return {};
  }

  void write_missing() {
    recording::Metadata missing{.name = kMissingParametersMetadata};
    for (const auto& [name, device] : devices) {
      if (device.channel || device.has_none) continue;
      missing.values[name] = device.problem.empty() ? "the recording ended first" : device.problem;
    }
    if (!missing.values.empty()) static_cast<void>(recorder.write(missing));
  }

  /// By when the thread ends; kNever before stop().
  MonotonicTime end() {
    const std::lock_guard lock(mutex);
    return end_at;
  }
  void stop() {
    if (!thread.is_running()) return;
    {
      const std::lock_guard lock(mutex);
      end_at = rt::now() + kEndMax;
    }
    wake.post();
    thread.join();
    consumer.reset();
  }

  rpc::Node& node;
  recording::Recorder& recorder;
  recording::Recorder::Track& track;  ///< Used by the thread.
  ParameterRecorderConfig config;
  std::map<std::string, Device> devices{};  ///< Used by the thread.
  rt::PiMutex mutex{};
  /// Devices that the thread does not know yet. Guarded by `mutex`, like the next three.
  std::vector<std::string> added_names;
  std::map<events::SourceId, MonotonicTime> changed{};
  std::vector<std::string> reports{};
  MonotonicTime end_at = kNever;
  std::unique_ptr<events::Consumer> consumer{};  ///< Set under the mutex.
  rt::Semaphore wake{};
  rt::Thread thread{};
};

expected<std::unique_ptr<ParameterRecorder>, SetupError> ParameterRecorder::start(
    rpc::Node& node, recording::Recorder& recorder, ParameterRecorderConfig config) {
  auto impl = std::make_unique<Impl>(node, recorder, std::move(config));
  auto begun = rt::Thread::start({.name = "rtpm-parameters", .realtime = rt::RealtimeMode::kOff},
                                 [raw = impl.get()] { raw->run(); });
  if (!begun) return unexpected{begun.error()};
  impl->thread = std::move(*begun);
  return std::unique_ptr<ParameterRecorder>(new ParameterRecorder(std::move(impl)));
}

ParameterRecorder::ParameterRecorder(std::unique_ptr<Impl> impl) noexcept
    : impl_(std::move(impl)) {}
ParameterRecorder::~ParameterRecorder() = default;

void ParameterRecorder::add(std::string device) {
  {
    const std::lock_guard lock(impl_->mutex);
    impl_->added_names.push_back(std::move(device));
  }
  impl_->wake.post();
}

std::vector<std::string> ParameterRecorder::take_reports() {
  const std::lock_guard lock(impl_->mutex);
  return std::exchange(impl_->reports, {});
}

void ParameterRecorder::stop() {
  impl_->stop();
}

namespace {

std::vector<driver::ParameterSetting> difference(const gvd::DeviceConfiguration& before,
                                                 const gvd::DeviceConfiguration& after) {
  std::vector<driver::ParameterSetting> settings;
  for (const gvd::Parameter& parameter : after.parameters) {
    const gvd::Parameter* const known = before.find(parameter.spec.name);
    if (known != nullptr && known->value == parameter.value) continue;
    settings.push_back({parameter.spec.name, parameter.value});
  }
  return settings;
}

/// @param count_left  values that may still be listed
void take(RecordedParameters& recorded, gvd::DeviceConfiguration configuration,
          std::uint64_t time_ns, std::size_t& count_left) {
  auto settings = difference(recorded.last, configuration);
  if (settings.size() < count_left) {
    count_left -= settings.size() + 1;
    recorded.changes.push_back({time_ns, configuration.revision, std::move(settings)});
  } else {
    ++recorded.omitted_count;
  }
  recorded.last = std::move(configuration);
}

}  // namespace

expected<std::vector<RecordedParameters>, SetupError> read_parameters(recording::FileReader& reader,
                                                                      std::uint64_t to_ns) {
  recording::Query query{.to_ns = to_ns};
  const std::string here = std::to_string(Stub::interface().fingerprint);
  for (const auto& [number, channel] : reader.channels()) {
    if (value_of(channel, kKindKey) != kParametersKind) continue;
    if (value_of(channel, kSchemaIdKey) != here) {
      return setup_error(
          printable(channel.topic) + " was recorded with another version of rtpm.configuration", "",
          "read it with the release that recorded it");
    }
    query.channel_ids.push_back(number);
  }
  if (query.channel_ids.empty()) return std::vector<RecordedParameters>{};
  std::map<std::string, RecordedParameters> found;
  std::string broken;
  std::size_t count_left = kChangedValuesMax;
  const auto read = reader.read(query, [&](const recording::Message& message) {
    const recording::Channel& channel = reader.channels().at(message.channel_id);
    auto configuration = gvd::configuration_in(message.data);
    if (!configuration) {
      broken = channel.topic;
      return false;
    }
    const std::string device = value_of(channel, kDeviceKey);
    const auto known = found.find(device);
    if (known == found.end()) {
      found.emplace(device, RecordedParameters{device, *configuration, *configuration});
    } else {
      take(known->second, std::move(*configuration), message.publish_time_ns, count_left);
    }
    return true;
  });
  if (!read) return unexpected{read.error()};
  if (!broken.empty()) {
    return setup_error(printable(broken) + " has a broken message", "",
                       "see what else is: rtpm bag check");
  }
  std::vector<RecordedParameters> all;
  for (auto& [device, recorded] : found)
    all.push_back(std::move(recorded));
  return all;
}

}  // namespace rtpm::capture
