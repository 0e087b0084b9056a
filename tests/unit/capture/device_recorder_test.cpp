#include "rtpm/capture/device_recorder.hpp"

#include <device_events.rtpm.events.hpp>

#include "../gvd/scripted_driver.hpp"
#include "../recording/recorded.hpp"
#include "event_recorder.hpp"
#include "rtpm/capture/channels.hpp"
#include "rtpm/gvd/device_event.hpp"
#include "rtpm/gvd/server.hpp"
#include "rtpm/gvd/wire.hpp"
#include "rtpm/rpc/server.hpp"
#include "rtpm/rt/memory.hpp"
#include "rtpm/test/alloc_guard.hpp"
#include "rtpm/test/os.hpp"

// Devices in recordings: their topics, descriptions, polled samples and commands.
namespace rtpm::capture {
namespace {

class DeviceRecorderTest : public testing::Test {
 protected:
  void SetUp() override {
    auto created = recording::Recorder::create(file_);
    ASSERT_TRUE(created) << created.error().text();
    recorder_ = std::move(*created);
  }
  void serve() {
    gvd::DeviceServerConfig config;
    config.thread.realtime = rt::RealtimeMode::kOff;
    auto device = gvd::DeviceServer::create(std::make_unique<test::ScriptedDriver>(), config);
    ASSERT_TRUE(device && (*device)->start());
    device_ = std::move(*device);
    auto server = rpc::Server::create({.realtime = rt::RealtimeMode::kOff});
    ASSERT_TRUE(server);
    server_ = std::move(*server);
    ASSERT_TRUE(server_->add("lab/lever", device_->servant()));
    ASSERT_TRUE(server_->start());
  }
  [[nodiscard]] std::unique_ptr<recording::FileReader> closed() {
    EXPECT_TRUE(recorder_->close());
    auto reader = recording::FileReader::open(file_);
    EXPECT_TRUE(reader);
    return reader ? std::move(*reader) : nullptr;
  }
  static events::EventView event_of(const device::Sample& sample, events::SourceId source) {
    return {.header = {.type = gvd::kSampled,
                       .source = source,
                       .sequence = 1,
                       .schema_id = device::SampledEvent::kSchemaId},
            .payload = rpc::struct_bytes(sample)};
  }

  recording::Folder folder_;
  std::string file_ = folder_.fresh("devices");
  std::unique_ptr<recording::Recorder> recorder_;
  std::unique_ptr<gvd::DeviceServer> device_;
  std::unique_ptr<rpc::Server> server_;
  rpc::Node node_{{.default_deadline = std::chrono::seconds{5}}};
};

TEST_F(DeviceRecorderTest, EventsOfANamedDeviceHaveItsTopic) {
  EventRecorder events(*recorder_);
  const std::vector<std::string> names{"lab/lever"};
  events.name_devices(names);
  const device::Sample sample;
  events.record(event_of(sample, gvd::source_of("lab/lever")), &device::SampledEvent::kDescriptor);
  EXPECT_EQ(events.take_new_devices(), names);
  EXPECT_TRUE(events.take_new_devices().empty());
  EXPECT_FALSE(events.take_new_unnamed());
  const auto reader = closed();
  ASSERT_NE(reader, nullptr);
  EXPECT_EQ(reader->channels().at(1).topic, "lab/lever/sampled");
  EXPECT_EQ(reader->channels().at(1).metadata.at(kDeviceKey), "lab/lever");
  EXPECT_EQ(reader->channels().at(1).metadata.at(kStructSizeKey),
            std::to_string(sizeof(device::Sample)));
}

TEST_F(DeviceRecorderTest, EventsOfADeviceThatIsNamedLaterGoOnUnderItsName) {
  EventRecorder events(*recorder_);
  const device::Sample sample;
  const events::SourceId source = gvd::source_of("lab/lever");
  events.record(event_of(sample, source), &device::SampledEvent::kDescriptor);
  EXPECT_TRUE(events.take_new_unnamed());
  EXPECT_FALSE(events.take_new_unnamed());
  events.name_devices(std::vector<std::string>{"lab/lever"});
  events.record(event_of(sample, source), &device::SampledEvent::kDescriptor);
  EXPECT_EQ(events.take_new_devices().size(), 1u);
  const auto reader = closed();
  ASSERT_NE(reader, nullptr);
  EXPECT_EQ(reader->channels().at(1).topic, "rtpm.device.Sampled/" + std::to_string(source));
  EXPECT_EQ(reader->channels().at(2).topic, "lab/lever/sampled");
}

TEST_F(DeviceRecorderTest, SamplesOfADescribedDeviceAreDrawn) {
  EventRecorder events(*recorder_);
  events.name_devices(std::vector<std::string>{"lab/lever"});
  events.add_view("lab/lever", test::ScriptedDriver{}.descriptor);
  const device::Sample sample;
  events.record(event_of(sample, gvd::source_of("lab/lever")), &device::SampledEvent::kDescriptor);
  const auto reader = closed();
  ASSERT_NE(reader, nullptr);
  std::map<std::string, std::string> schemas;
  for (const auto& [number, channel] : reader->channels()) {
    if (channel.metadata.at(kKindKey) != kViewKind) continue;
    schemas[channel.topic] = reader->schemas().at(channel.schema_id).name;
    EXPECT_EQ(recording::read_all(*reader, {.channel_ids = {number}}).size(), 1u) << channel.topic;
  }
  EXPECT_EQ(schemas,
            (std::map<std::string, std::string>{{"lab/lever/force", "foxglove.SceneUpdate"},
                                                {"lab/lever/pose", "foxglove.PoseInFrame"},
                                                {"rtpm/tf", "foxglove.FrameTransforms"}}));
}

TEST_F(DeviceRecorderTest, ADescriptionIsRecordedAsItCame) {
  serve();
  DeviceRecorder devices(node_, *recorder_);
  const std::string url = server_->url("lab/lever");
  ASSERT_TRUE(devices.describe(url));
  const auto reader = closed();
  ASSERT_NE(reader, nullptr);
  const recording::Channel& channel = reader->channels().at(1);
  EXPECT_EQ(channel.topic, url + "/description");
  EXPECT_EQ(channel.metadata.at(kKindKey), kDescriptionKind);
  EXPECT_EQ(reader->schemas().at(channel.schema_id).name, "rtpm.device.Description");
  const auto messages = recording::read_all(*reader);
  ASSERT_EQ(messages.size(), 1u);
  ASSERT_TRUE(rpc::is_valid_table<device::Description>(
      std::as_bytes(std::span(messages[0].text.data(), messages[0].text.size()))));
  const auto* const table = flatbuffers::GetRoot<device::Description>(messages[0].text.data());
  EXPECT_EQ(table->model()->str(), "scripted");
  EXPECT_EQ(table->rate_hz(), 1000);
}

TEST_F(DeviceRecorderTest, EachNewSampleThatAPollFindsIsRecorded) {
  serve();
  DeviceRecorder devices(node_, *recorder_);
  ASSERT_TRUE(devices.poll(server_->url("lab/lever"), 500));
  EXPECT_TRUE(test::await([&] { return device_->newest()->sequence >= 50; }));
  devices.stop();
  EXPECT_TRUE(devices.failed_counts().empty());
  const auto reader = closed();
  ASSERT_NE(reader, nullptr);
  EXPECT_EQ(reader->channels().at(2).metadata.at(kKindKey), kSampleKind);
  const auto messages = recording::read_all(*reader, {.channel_ids = {2}});
  ASSERT_FALSE(messages.empty());
  for (std::size_t i = 0; i < messages.size(); ++i) {
    const auto* const table = flatbuffers::GetRoot<device::Sampled>(messages[i].text.data());
    EXPECT_EQ(table->sample()->sequence(), messages[i].sequence);
    if (i > 0) {
      EXPECT_GT(messages[i].sequence, messages[i - 1].sequence);
    }
  }
}

TEST_F(DeviceRecorderTest, CommandsAreRecordedWithoutAllocationAndWithoutTheirLease) {
  auto commands = CommandRecorder::create(*recorder_, "lab/lever");
  ASSERT_TRUE(commands);
  const gvd::ClientCommand command{0x1234'5678'9abc, 9, std::chrono::milliseconds{10},
                                   driver::Setpoint::with_wrench({{1.5, -0.0, 3}, {}})};
  const device::Command wire = gvd::to_wire(command);
  {
    const rt::NoAllocationScope no_allocation;
    (*commands)->record(wire, 4711);
  }
  const auto reader = closed();
  ASSERT_NE(reader, nullptr);
  EXPECT_EQ(reader->channels().at(1).topic, "lab/lever/command");
  const auto messages = recording::read_all(*reader);
  ASSERT_EQ(messages.size(), 1u);
  EXPECT_EQ(messages[0].sequence, 4711u);
  gvd::ClientCommand without_lease = command;
  without_lease.lease = 0;
  const device::Command expected_command = gvd::to_wire(without_lease);
  const auto* const request = flatbuffers::GetRoot<device::CommandRequest>(messages[0].text.data());
  EXPECT_EQ(recording::text_of(rpc::struct_bytes(*request->command())),
            recording::text_of(rpc::struct_bytes(expected_command)));
}

}  // namespace
}  // namespace rtpm::capture
