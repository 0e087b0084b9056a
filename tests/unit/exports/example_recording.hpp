#pragma once

#include <cstdint>
#include <device.rtpm.hpp>
#include <device_events.rtpm.events.hpp>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "../recording/recorded.hpp"
#include "rtpm/driver/descriptor.hpp"
#include "rtpm/driver/sample.hpp"
#include "rtpm/gvd/wire.hpp"
#include "rtpm/schema/dynamic.hpp"

namespace rtpm::exports::test {

inline constexpr std::uint64_t kBeginNs = 1'700'000'000'000'000'000;

/// A schema with every kind of field.
inline constexpr const char* kSchema = R"(
attribute "rtpm_event";
attribute "rtpm_unit";
namespace lab;
enum Phase : ubyte { Training = 0, Test = 1 }
struct Pair { first:float; numbers:[short:2]; }
table Note { text:string; }
table Trial (rtpm_event: 77) {
  number:uint;
  phase:Phase = Test;
  response:string;
  force:double (rtpm_unit: "N");
  pair:Pair;
  note:Note;
  samples:[double];
  picture:[ubyte];
  seed:ulong;
  late:int = null;
}
)";

inline driver::Descriptor arm() {
  return {.device_class = driver::DeviceClass::kHaptic,
          .model = "Arm",
          .serial = "1",
          .frame = "arm/base",
          .axes = {{.name = "x", .is_actuated = true}},
          .buttons = {"stylus"},
          .analogs = {{.name = "grip", .unit = "N", .low = 0, .high = 10}},
          .joints = {{.name = "elbow", .unit = "rad"}}};
}

inline driver::Sample arm_sample(int i) {
  driver::Sample sample;
  sample.sequence = static_cast<std::uint64_t>(i);
  sample.pose.position_m = {0.1 * i, 1.0 / 3, -2};
  sample.wrench_applied.force_newton = {1e-7 * i, 0, 5};
  sample.joints[0] = 0.5;
  sample.analogs[0] = 7.5f;
  sample.buttons = 1;
  sample.lifecycle = driver::Lifecycle::kActive;
  return sample;
}

/// Writes recordings as `rtpm record` does.
class Example {
 public:
  explicit Example(const std::string& path) {
    auto writer = recording::FileWriter::create(path, {.profile = "rtpm"});
    EXPECT_TRUE(writer);
    writer_ = std::move(*writer);
  }
  void end() { EXPECT_TRUE(writer_->close()); }

  std::uint16_t add(const schema::Dynamic& dynamic, const std::string& type,
                    const std::string& topic, std::map<std::string, std::string> metadata) {
    const auto schema = writer_->add_schema(
        {.name = type, .encoding = "flatbuffer", .data = dynamic.flat_reflection(type)});
    EXPECT_TRUE(schema);
    return add({.schema_id = *schema,
                .topic = topic,
                .message_encoding = "flatbuffer",
                .metadata = std::move(metadata)});
  }
  std::uint16_t add(const recording::Channel& channel) {
    const auto number = writer_->add_channel(channel);
    EXPECT_TRUE(number);
    return *number;
  }
  void put(std::uint16_t channel, ConstBytes data) {
    const std::uint64_t time_ns = kBeginNs + 1'000'000ULL * count_;
    EXPECT_TRUE(writer_->write({.channel_id = channel,
                                .sequence = ++count_,
                                .log_time_ns = time_ns,
                                .publish_time_ns = time_ns,
                                .data = data}));
  }
  void put(std::uint16_t channel, const flatbuffers::FlatBufferBuilder& builder) {
    put(channel, std::as_bytes(std::span(builder.GetBufferPointer(), builder.GetSize())));
  }

  /// An arm's description and `count` samples.
  void put_arm(int count, const std::string& name = "lab/arm-0") {
    const rpc::InterfaceDescriptor& device = device::DeviceClient::interface();
    std::string error;
    auto dynamic = schema::Dynamic::make(std::string(device.schema), device.name, error);
    flatbuffers::FlatBufferBuilder builder;
    builder.Finish(gvd::to_wire(arm(), {}, builder));
    put(add(*dynamic, "rtpm.device.Description", name + "/description",
            {{"rtpm.kind", "description"},
             {"rtpm.device", name},
             {"rtpm.schema_id", std::to_string(device.fingerprint)}}),
        builder);
    const auto& event = device::SampledEvent::kDescriptor;
    dynamic = schema::Dynamic::make_for_event(std::string(event.schema), event.name, error);
    const std::uint16_t samples = add(*dynamic, "rtpm.device.Sampled", name + "/sampled",
                                      {{"rtpm.kind", "event"},
                                       {"rtpm.device", name},
                                       {"rtpm.schema_id", std::to_string(event.schema_id)}});
    for (int i = 0; i < count; ++i) {
      const device::Sample wire = gvd::to_wire(arm_sample(i));
      flatbuffers::FlatBufferBuilder each;
      each.Finish(device::CreateSampled(each, &wire));
      put(samples, each);
    }
  }

  /// A Trial for each JSON text.
  void put_trials(const std::vector<std::string>& texts) {
    std::string error;
    const auto dynamic = schema::Dynamic::make_for_event(kSchema, "lab.Trial", error);
    ASSERT_NE(dynamic, nullptr) << error;
    const std::uint16_t channel = add(*dynamic, "lab.Trial", "lab.Trial/3", {});
    for (const std::string& text : texts) {
      const auto bytes = dynamic->encode(dynamic->event(), text, error);
      ASSERT_TRUE(bytes) << error;
      put(channel, *bytes);
    }
  }

 private:
  std::unique_ptr<recording::FileWriter> writer_;
  std::uint32_t count_ = 0;

 public:
  [[nodiscard]] recording::FileWriter& writer() { return *writer_; }
};

/// Puts more than 256 MiB, which need little space: an arm's samples, and then a text of 64 KiB
/// each millisecond.
inline void put_large(Example& example) {
  constexpr std::size_t kTextSize = std::size_t{64} << 10;
  constexpr std::size_t kTextCount = 4096;
  example.put_arm(1000);
  std::string error;
  const auto dynamic = schema::Dynamic::make_for_event(kSchema, "lab.Trial", error);
  ASSERT_NE(dynamic, nullptr) << error;
  const std::uint16_t texts = example.add(*dynamic, "lab.Trial", "lab.Trial/3", {});
  const std::string text(kTextSize, 'a');
  const auto bytes =
      dynamic->encode(dynamic->event(), R"({"number":7,"response":")" + text + R"("})", error);
  ASSERT_TRUE(bytes) << error;
  for (std::size_t i = 0; i < kTextCount; ++i)
    example.put(texts, *bytes);
}

}  // namespace rtpm::exports::test
