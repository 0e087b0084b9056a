#pragma once

#include <cstring>
#include <device_events.rtpm.events.hpp>
#include <string>
#include <vector>

#include "../gvd/scripted_driver.hpp"
#include "../recording/recorded.hpp"
#include "rtpm/capture/channels.hpp"
#include "rtpm/gvd/device_event.hpp"
#include "rtpm/gvd/wire.hpp"
#include "rtpm/replay/recorded.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/test/os.hpp"

/// Recordings of a device, made for tests.
namespace rtpm::replay {

using rtpm::test::await;

inline std::vector<std::byte> finished(flatbuffers::FlatBufferBuilder& builder) {
  const auto bytes = std::as_bytes(std::span(builder.GetBufferPointer(), builder.GetSize()));
  return {bytes.begin(), bytes.end()};
}

inline std::vector<std::byte> description_of(const driver::Descriptor& descriptor) {
  flatbuffers::FlatBufferBuilder builder;
  builder.Finish(gvd::to_wire(descriptor,
                              {.period = std::chrono::milliseconds{1},
                               .hold_max = std::chrono::milliseconds{100},
                               .ramp = std::chrono::milliseconds{20},
                               .operator_priority = 28000},
                              builder));
  return finished(builder);
}

/// The sample of cycle `sequence` of an active device, different from all others.
inline device::Sample sample_of(std::uint64_t sequence) {
  driver::Sample sample;
  sample.sequence = sequence;
  sample.host_time = time_from_ns(static_cast<std::int64_t>(sequence) * 1'000'003);
  sample.pose.position_m = {1e-3 * static_cast<double>(sequence), -0.0, 0.25};
  sample.success_rate = 0.97F;
  sample.faults.set(driver::Fault::kSoftWall);
  sample.button_edges[3] = static_cast<std::uint16_t>(sequence);
  sample.lifecycle = driver::Lifecycle::kActive;
  return gvd::to_wire(sample);
}

inline std::string bytes_of(const device::Sample& sample) {
  return recording::text_of(rpc::struct_bytes(sample));
}

/// "lab/lever" with `count` samples from sequence 100 on, 1 ms apart.
inline RecordedDevice lever(std::size_t count) {
  RecordedDevice device{.name = "lab/lever",
                        .description = description_of(test::ScriptedDriver{}.descriptor)};
  for (std::size_t i = 0; i < count; ++i) {
    device.samples.push_back(sample_of(100 + i));
    device.times.push_back(std::chrono::milliseconds{i});
  }
  return device;
}

/// Writes the same records as rtpm::capture.
class RunWriter {
 public:
  static constexpr std::uint64_t kBeginNs = 1'700'000'000'000'000'000;

  explicit RunWriter(const std::string& path, std::uint64_t begin_ns = kBeginNs)
      : begin_ns_(begin_ns) {
    auto writer = recording::FileWriter::create(path);
    EXPECT_TRUE(writer);
    if (writer) writer_ = std::move(*writer);
  }
  std::uint16_t add_channel(const std::string& topic, std::map<std::string, std::string> metadata) {
    const auto channel = writer_->add_channel(
        {.topic = topic, .message_encoding = "flatbuffer", .metadata = std::move(metadata)});
    EXPECT_TRUE(channel);
    return channel.value_or(0);
  }
  void describe(const std::string& device,
                std::uint64_t fingerprint = device::DeviceClient::interface().fingerprint) {
    const auto channel = add_channel(device + "/description",
                                     {{capture::kKindKey, capture::kDescriptionKind},
                                      {capture::kDeviceKey, device},
                                      {capture::kSchemaIdKey, std::to_string(fingerprint)}});
    put(channel, 0, 0, description_of(test::ScriptedDriver{}.descriptor));
  }
  std::uint16_t add_samples(const std::string& device, const char* kind = capture::kEventKind,
                            std::uint64_t schema_id = device::SampledEvent::kSchemaId) {
    return add_channel(device + "/sampled",
                       {{capture::kKindKey, kind},
                        {capture::kDeviceKey, device},
                        {capture::kTypeKey, std::to_string(gvd::kSampled)},
                        {capture::kNameKey, "rtpm.device.Sampled"},
                        {capture::kSourceKey, std::to_string(gvd::source_of(device))},
                        {capture::kSchemaIdKey, std::to_string(schema_id)},
                        {capture::kStructSizeKey, std::to_string(sizeof(device::Sample))}});
  }
  void put_sample(std::uint16_t channel, std::uint64_t sequence, std::int64_t at_ms) {
    put_sample_at(channel, sequence, begin_ns_ + static_cast<std::uint64_t>(at_ms * 1'000'000));
  }
  void put_sample_at(std::uint16_t channel, std::uint64_t sequence, std::uint64_t time_ns) {
    const device::Sample sample = sample_of(sequence);
    flatbuffers::FlatBufferBuilder builder;
    builder.Finish(device::CreateSampled(builder, &sample));
    put_at(channel, static_cast<std::uint32_t>(sequence), time_ns, finished(builder));
  }
  void put(std::uint16_t channel, std::uint32_t sequence, std::int64_t at_ms,
           const std::vector<std::byte>& data) {
    put_at(channel, sequence, begin_ns_ + static_cast<std::uint64_t>(at_ms * 1'000'000), data);
  }
  void put_at(std::uint16_t channel, std::uint32_t sequence, std::uint64_t time_ns,
              const std::vector<std::byte>& data) {
    EXPECT_TRUE(writer_->write({.channel_id = channel,
                                .sequence = sequence,
                                .log_time_ns = time_ns,
                                .publish_time_ns = time_ns,
                                .data = data}));
  }
  void write(const recording::Metadata& metadata) { EXPECT_TRUE(writer_->write(metadata)); }
  void close() { EXPECT_TRUE(writer_->close()); }

 private:
  std::uint64_t begin_ns_;
  std::unique_ptr<recording::FileWriter> writer_{};
};

}  // namespace rtpm::replay
