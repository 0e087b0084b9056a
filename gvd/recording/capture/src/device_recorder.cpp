#include "rtpm/capture/device_recorder.hpp"

#include <device.rtpm.hpp>
#include <device_events.rtpm.events.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "device_schemas.hpp"
#include "rtpm/capture/channels.hpp"
#include "rtpm/capture/event_schemas.hpp"
#include "rtpm/gvd/device_event.hpp"
#include "rtpm/gvd/poller.hpp"
#include "rtpm/gvd/wire.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::capture {
namespace {

using Sampled = device::SampledEvent;

/// Records the samples of one device, on its poller's thread.
class Samples final : public gvd::SampleSink {
 public:
  Samples(recording::Recorder& recorder, std::uint16_t channel)
      : recorder_(recorder), track_(recorder.add_track()), channel_(channel) {}

  void push(const driver::Sample& sample) override {
    const device::Sample wire = gvd::to_wire(sample);
    const auto table = table_of(wire);
    const std::uint64_t now_ns = recorder_.log_time_ns(rt::now());
    static_cast<void>(track_.put({.channel_id = channel_,
                                  .sequence = static_cast<std::uint32_t>(sample.sequence),
                                  .log_time_ns = now_ns,
                                  .publish_time_ns = now_ns,
                                  .data = table}));
  }

 private:
  [[nodiscard]] static std::vector<std::byte> table_of(const device::Sample& sample) {
    flatbuffers::FlatBufferBuilder builder;
    builder.Finish(device::CreateSampled(builder, &sample));
    const auto bytes = std::as_bytes(std::span(builder.GetBufferPointer(), builder.GetSize()));
    return {bytes.begin(), bytes.end()};
  }

  recording::Recorder& recorder_;
  recording::Recorder::Track& track_;
  std::uint16_t channel_;
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
    const auto channel = add_device_channel(
        recorder, name,
        {.kind = kDescriptionKind, .leaf = "description", .type = "rtpm.device.Description"});
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

  expected<std::uint16_t, SetupError> add_samples(const std::string& name) {
    const schema::Dynamic* const dynamic = schemas.find(&Sampled::kDescriptor);
    RTPM_ASSERT(dynamic != nullptr, "generated code has a schema that can be read");
    const auto bytes = dynamic->reflection();
    const auto schema = recorder.add_schema({.name = std::string(Sampled::kDescriptor.name),
                                             .encoding = "flatbuffer",
                                             .data = {bytes.begin(), bytes.end()}});
    if (!schema) return unexpected{schema.error()};
    return recorder.add_channel(
        {.schema_id = *schema,
         .topic = device_topic(name, Sampled::kDescriptor.name),
         .message_encoding = "flatbuffer",
         .metadata = {{kKindKey, kSampleKind},
                      {kDeviceKey, name},
                      {kTypeKey, std::to_string(Sampled::kType)},
                      {kNameKey, std::string(Sampled::kDescriptor.name)},
                      {kSourceKey, std::to_string(gvd::source_of(name))},
                      {kSchemaIdKey, std::to_string(Sampled::kSchemaId)},
                      {kStructSizeKey, std::to_string(sizeof(device::Sample))}}});
  }

  rpc::Node& node;
  recording::Recorder& recorder;
  recording::Recorder::Track& track;
  EventSchemas schemas{};
  std::vector<Polled> polled{};
};

DeviceRecorder::DeviceRecorder(rpc::Node& node, recording::Recorder& recorder)
    : impl_(std::make_unique<Impl>(node, recorder)) {}
DeviceRecorder::~DeviceRecorder() = default;

expected<void, SetupError> DeviceRecorder::describe(const std::string& name) {
  auto stub = device::DeviceClient::bind(impl_->node, name);
  if (!stub) return unexpected{stub.error()};
  const auto description = stub->describe();
  if (!description) {
    return setup_error("device " + name + " was found, but not described", description.error());
  }
  return impl_->put_description(name, description->bytes());
}

expected<void, SetupError> DeviceRecorder::poll(const std::string& name, double rate_hz) {
  if (auto described = describe(name); !described) return described;
  const auto channel = impl_->add_samples(name);
  if (!channel) return unexpected{channel.error()};
  auto sink = std::make_unique<Samples>(impl_->recorder, *channel);
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

}  // namespace rtpm::capture
