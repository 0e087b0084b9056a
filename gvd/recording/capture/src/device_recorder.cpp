#include "rtpm/capture/device_recorder.hpp"

#include <cstring>
#include <device.rtpm.hpp>
#include <device_events.rtpm.events.hpp>
#include <mutex>
#include <utility>
#include <vector>

#include "flatbuffer_channel.hpp"
#include "rtpm/base/assert.hpp"
#include "rtpm/capture/channels.hpp"
#include "rtpm/gvd/device_event.hpp"
#include "rtpm/gvd/poller.hpp"
#include "rtpm/gvd/wire.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/pi_mutex.hpp"
#include "view_recorder.hpp"

namespace rtpm::capture {
namespace {

using Sampled = device::SampledEvent;

/// Adds the channel "lab/arm0/`leaf`" for tables of `type` in device.fbs.
expected<std::uint16_t, SetupError> add_device_channel(recording::Recorder& recorder,
                                                       const std::string& device, const char* kind,
                                                       const char* leaf, const char* type) {
  const rpc::InterfaceDescriptor& interface = device::DeviceClient::interface();
  std::string error;
  const auto dynamic = schema::Dynamic::make(std::string(interface.schema), interface.name, error);
  RTPM_ASSERT(dynamic != nullptr, "generated code has a schema that can be read");
  return add_flatbuffer_channel(recorder, *dynamic, type, device + "/" + leaf,
                                {{kKindKey, kind},
                                 {kDeviceKey, device},
                                 {kSourceKey, std::to_string(gvd::source_of(device))},
                                 {kSchemaIdKey, std::to_string(interface.fingerprint)}});
}

expected<std::uint16_t, SetupError> add_samples_channel(recording::Recorder& recorder,
                                                        const std::string& device) {
  const events::EventDescriptor& type = Sampled::kDescriptor;
  std::string error;
  const auto dynamic = schema::Dynamic::make_for_event(std::string(type.schema), type.name, error);
  RTPM_ASSERT(dynamic != nullptr, "generated code has a schema that can be read");
  return add_flatbuffer_channel(recorder, *dynamic, std::string(type.name),
                                device_topic(device, type.name),
                                {{kKindKey, kSampleKind},
                                 {kDeviceKey, device},
                                 {kTypeKey, std::to_string(Sampled::kType)},
                                 {kNameKey, std::string(type.name)},
                                 {kSourceKey, std::to_string(gvd::source_of(device))},
                                 {kSchemaIdKey, std::to_string(Sampled::kSchemaId)},
                                 {kStructSizeKey, std::to_string(sizeof(device::Sample))}});
}

/// Records the samples of one device, on its poller's thread.
class Samples final : public gvd::SampleSink {
 public:
  Samples(recording::Recorder& recorder, std::uint16_t channel, const std::string& device,
          const driver::Descriptor& descriptor)
      : recorder_(recorder),
        track_(recorder.add_track()),
        channel_(channel),
        source_(gvd::source_of(device)),
        view_(recorder, track_) {
    view_.add(device, descriptor);
  }

  void push(const driver::Sample& sample) override {
    const device::Sample wire = gvd::to_wire(sample);
    flatbuffers::FlatBufferBuilder builder;
    builder.Finish(device::CreateSampled(builder, &wire));
    const std::uint64_t now_ns = recorder_.log_time_ns(rt::now());
    static_cast<void>(track_.put({.channel_id = channel_,
                                  .sequence = static_cast<std::uint32_t>(sample.sequence),
                                  .log_time_ns = now_ns,
                                  .publish_time_ns = now_ns,
                                  .data = rpc::table_bytes(builder)}));
    view_.record(source_, sample, now_ns, now_ns);
  }

 private:
  recording::Recorder& recorder_;
  recording::Recorder::Track& track_;
  std::uint16_t channel_;
  events::SourceId source_;
  ViewRecorder view_;
};

}  // namespace

struct DeviceRecorder::Impl {
  struct Polled {
    std::string name;
    std::unique_ptr<Samples> sink;
    gvd::DevicePoller poller;
  };

  Impl(rpc::Node& bound, recording::Recorder& given)
      : node(bound), recorder(given), track(given.add_track()) {}

  expected<void, SetupError> put_description(const std::string& name, ConstBytes bytes) {
    const auto channel = add_device_channel(recorder, name, kDescriptionKind, "description",
                                            "rtpm.device.Description");
    if (!channel) return unexpected{channel.error()};
    const std::uint64_t now_ns = recorder.log_time_ns(rt::now());
    if (!track.put({.channel_id = *channel,
                    .sequence = 0,
                    .log_time_ns = now_ns,
                    .publish_time_ns = now_ns,
                    .data = bytes})) {
      return setup_error("the description of " + name + " was not recorded",
                         "it is larger than a message may be");
    }
    return {};
  }

  rpc::Node& node;
  recording::Recorder& recorder;
  recording::Recorder::Track& track;
  std::vector<Polled> polled{};
};

DeviceRecorder::DeviceRecorder(rpc::Node& node, recording::Recorder& recorder)
    : impl_(std::make_unique<Impl>(node, recorder)) {}
DeviceRecorder::~DeviceRecorder() = default;

expected<driver::Descriptor, SetupError> DeviceRecorder::describe(const std::string& name) {
  auto stub = device::DeviceClient::bind(impl_->node, name);
  if (!stub) return unexpected{stub.error()};
  const auto description = stub->describe();
  if (!description) {
    return setup_error("device " + name + " was found, but not described", description.error());
  }
  if (auto put = impl_->put_description(name, description->bytes()); !put)
    return unexpected{put.error()};
  return gvd::from_wire(**description);
}

expected<void, SetupError> DeviceRecorder::poll(const std::string& name, double rate_hz) {
  const auto described = describe(name);
  if (!described) return unexpected{described.error()};
  const auto channel = add_samples_channel(impl_->recorder, name);
  if (!channel) return unexpected{channel.error()};
  auto sink = std::make_unique<Samples>(impl_->recorder, *channel, name, *described);
  gvd::DevicePollerConfig config{.rate_hz = rate_hz};
  auto poller = gvd::DevicePoller::start(impl_->node, name, config, *sink);
  if (!poller) return unexpected{poller.error()};
  impl_->polled.push_back({name, std::move(sink), std::move(*poller)});
  return {};
}

void DeviceRecorder::stop() noexcept {
  for (Impl::Polled& polled : impl_->polled)
    polled.poller.stop();
}

std::map<std::string, std::uint64_t> DeviceRecorder::failed_counts() const {
  std::map<std::string, std::uint64_t> counts;
  for (const Impl::Polled& polled : impl_->polled) {
    const std::uint64_t count = polled.poller.counters().failed_count;
    if (count > 0) counts[polled.name] = count;
  }
  return counts;
}

struct CommandRecorder::Impl {
  Impl(recording::Recorder& given, std::uint16_t number)
      : recorder(given), track(given.add_track()), channel(number) {
    flatbuffers::FlatBufferBuilder builder;
    const device::Command blank{};
    builder.Finish(device::CreateCommandRequest(builder, &blank));
    const ConstBytes bytes = rpc::table_bytes(builder);
    table.assign(bytes.begin(), bytes.end());
    const auto* const at = static_cast<const void*>(
        flatbuffers::GetRoot<device::CommandRequest>(table.data())->command());
    offset = static_cast<std::size_t>(static_cast<const std::byte*>(at) - table.data());
  }

  recording::Recorder& recorder;
  recording::Recorder::Track& track;
  std::uint16_t channel;
  rt::PiMutex mutex{};
  std::vector<std::byte> table{};  ///< A finished CommandRequest.
  std::size_t offset = 0;          ///< The offset of the command within it.
};

expected<std::unique_ptr<CommandRecorder>, SetupError> CommandRecorder::create(
    recording::Recorder& recorder, const std::string& device) {
  const auto channel =
      add_device_channel(recorder, device, kCommandKind, "command", "rtpm.device.CommandRequest");
  if (!channel) return unexpected{channel.error()};
  return std::unique_ptr<CommandRecorder>(
      new CommandRecorder(std::make_unique<Impl>(recorder, *channel)));
}

CommandRecorder::CommandRecorder(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
CommandRecorder::~CommandRecorder() = default;

void CommandRecorder::record(const device::Command& command,
                             std::uint64_t sample_sequence) noexcept {
  gvd::ClientCommand without_lease = gvd::from_wire(command);
  without_lease.lease = 0;
  const device::Command kept = gvd::to_wire(without_lease);
  const std::lock_guard lock(impl_->mutex);
  std::memcpy(impl_->table.data() + impl_->offset, &kept, sizeof kept);
  const std::uint64_t now_ns = impl_->recorder.log_time_ns(rt::now());
  static_cast<void>(impl_->track.put({.channel_id = impl_->channel,
                                      .sequence = static_cast<std::uint32_t>(sample_sequence),
                                      .log_time_ns = now_ns,
                                      .publish_time_ns = now_ns,
                                      .data = impl_->table}));
}

}  // namespace rtpm::capture
