#include "rtpm/capture/cut.hpp"

#include <gtest/gtest.h>

#include <configuration.rtpm.hpp>
#include <trial.rtpm.events.hpp>

#include "recorded_run.hpp"
#include "rtpm/capture/parameters.hpp"
#include "rtpm/capture/read_events.hpp"
#include "rtpm/capture/session.hpp"
#include "rtpm/gvd/client.hpp"
#include "rtpm/replay/player.hpp"

// A part from the middle of a recording stands by itself.
namespace rtpm::replay {
namespace {

using std::chrono::seconds;

/// "lab/lever" from 0 to 2 s, of which everything but samples is in the first second.
class CutFromTheMiddle : public testing::Test {
 protected:
  static constexpr std::uint64_t kCutNs = RunWriter::kBeginNs + 1'000'000'000;

  void SetUp() override {
    RunWriter writer(file_);
    writer.describe("lab/lever");
    put_parameters(writer, {1, 2});
    put_events(writer);
    const auto samples = writer.add_samples("lab/lever");
    for (int i = 0; i < 200; ++i)
      writer.put_sample(samples, 100 + static_cast<std::uint64_t>(i), 10 * i);
    writer.write(capture::session_metadata({.participant = "P07"}));
    writer.close();
  }
  template <class Event>
  static std::uint16_t channel_of(RunWriter& writer, const std::string& topic) {
    const auto& type = Event::kDescriptor;
    std::map<std::string, std::string> metadata{
        {capture::kKindKey, capture::kEventKind},
        {capture::kTypeKey, std::to_string(type.type)},
        {capture::kNameKey, std::string(type.name)},
        {capture::kSourceKey, std::to_string(gvd::source_of("lab/lever"))},
        {capture::kSchemaIdKey, std::to_string(type.schema_id)}};
    return writer.add_channel(topic, std::move(metadata));
  }
  /// The configuration with each of these revisions, 100 ms apart.
  static void put_parameters(RunWriter& writer, const std::vector<std::uint64_t>& revisions) {
    const auto fingerprint = configuration::ConfigurationClient::interface().fingerprint;
    const auto channel = writer.add_channel("lab/lever/parameters",
                                            {{capture::kKindKey, capture::kParametersKind},
                                             {capture::kDeviceKey, "lab/lever"},
                                             {capture::kSchemaIdKey, std::to_string(fingerprint)}});
    std::int64_t at_ms = 0;
    for (const std::uint64_t revision : revisions) {
      configuration::ListReplyT reply;
      reply.model = "scripted";
      reply.revision = revision;
      flatbuffers::FlatBufferBuilder builder;
      builder.Finish(configuration::ListReply::Pack(builder, &reply));
      writer.put(channel, 0, at_ms += 100, finished(builder));
    }
  }
  static void put_events(RunWriter& writer) {
    const auto trials = channel_of<TrialEvent>(writer, "rtpm.Trial/0");
    const auto put_trial = [&](std::int64_t at_ms, TrialPhase phase, std::uint32_t number) {
      TrialT trial;
      trial.phase = phase;
      trial.number = number;
      flatbuffers::FlatBufferBuilder builder;
      builder.Finish(Trial::Pack(builder, &trial));
      writer.put(trials, 0, at_ms, finished(builder));
    };
    put_trial(100, TrialPhase::Begin, 1);
    put_trial(200, TrialPhase::End, 1);
    put_trial(300, TrialPhase::Begin, 2);
    put_trial(400, TrialPhase::Mark, 2);
    const auto faults = channel_of<device::FaultChangedEvent>(writer, "lab/lever/fault_changed");
    const auto put_fault = [&](std::int64_t at_ms, std::uint32_t begun, std::uint32_t ended) {
      const device::FaultChange change(7, begun, ended);
      flatbuffers::FlatBufferBuilder builder;
      builder.Finish(device::CreateFaultChanged(builder, &change));
      writer.put(faults, 0, at_ms, finished(builder));
    };
    put_fault(100, 0b011, 0);
    put_fault(200, 0b100, 0b001);
    const auto leases = channel_of<device::LeaseChangedEvent>(writer, "lab/lever/lease_changed");
    using enum gvd::LeaseState;
    for (const gvd::LeaseState state : {kHeld, kReleased, kHeld}) {
      const device::LeaseChange change(7, static_cast<std::uint8_t>(state));
      flatbuffers::FlatBufferBuilder builder;
      builder.Finish(device::CreateLeaseChanged(builder, &change));
      writer.put(leases, 0, 500, finished(builder));
    }
  }

  recording::Folder folder_;
  std::string file_ = folder_.fresh("run");
  std::string part_ = folder_.fresh("part");
};

TEST_F(CutFromTheMiddle, CanBePlayed) {
  ASSERT_TRUE(capture::cut(file_, part_, {.from_ns = kCutNs}));
  const auto recorded = load(part_);
  ASSERT_TRUE(recorded) << recorded.error().text();
  ASSERT_EQ(recorded->devices.size(), 1u);
  EXPECT_EQ(recorded->devices[0].samples.size(), 100u);
  rpc::Node node{{.default_deadline = seconds{5}}};
  PlayerConfig config{.end = End::kHold};
  config.server.realtime = rt::RealtimeMode::kOff;
  auto player = Player::create(node, *recorded, std::move(config));
  ASSERT_TRUE(player) << player.error().text();
  ASSERT_TRUE((*player)->start());
  const auto client = gvd::DeviceClient::open(node, (*player)->served().at(0).url);
  ASSERT_TRUE(client) << client.error().text();
  EXPECT_EQ(client->descriptor().model, "scripted");
}

TEST_F(CutFromTheMiddle, BeginsWithWhatHeldThen) {
  const auto count = capture::cut(file_, part_, {.from_ns = kCutNs});
  ASSERT_TRUE(count) << count.error().text();
  EXPECT_EQ(*count, 105u) << "description, parameters, trial, faults, lease; and 100 samples";
  const auto reader = recording::FileReader::open(part_);
  ASSERT_TRUE(reader) << reader.error().text();
  EXPECT_EQ((*reader)->statistics().begin_ns, kCutNs) << "it is no longer than its part";
  const auto parameters = capture::read_parameters(**reader);
  ASSERT_TRUE(parameters) << parameters.error().text();
  ASSERT_EQ(parameters->size(), 1u);
  EXPECT_EQ(parameters->front().first.revision, 2u) << "the last ones before";
  const auto metadata = (*reader)->read_metadata();
  ASSERT_TRUE(metadata);
  EXPECT_EQ(capture::session_of(*metadata), capture::Session{.participant = "P07"});

  std::vector<std::uint32_t> trials;
  ASSERT_TRUE(capture::read_events<TrialEvent>(**reader, [&](const auto& event) {
    trials.push_back(event.payload.number());
    EXPECT_EQ(event.payload.phase(), TrialPhase::Begin);
    EXPECT_EQ(event.publish_time_ns, kCutNs - 700'000'000) << "when it began";
    return true;
  }));
  EXPECT_EQ(trials, std::vector<std::uint32_t>{2});
  std::vector<std::uint32_t> begun;
  ASSERT_TRUE(capture::read_events<device::FaultChangedEvent>(**reader, [&](const auto& event) {
    begun.push_back(event.payload.begun());
    EXPECT_EQ(event.payload.ended(), 0u);
    return true;
  }));
  EXPECT_EQ(begun, std::vector<std::uint32_t>{0b110}) << "those that last";
  ASSERT_TRUE(capture::read_events<device::LeaseChangedEvent>(**reader, [&](const auto& event) {
    EXPECT_EQ(event.payload.state(), 1);
    return true;
  }));
}

TEST_F(CutFromTheMiddle, HasNothingOfTopicsThatWereNotChosen) {
  const auto whole = recording::FileReader::open(file_);
  ASSERT_TRUE(whole);
  std::vector<std::uint16_t> chosen;
  for (const auto& [number, channel] : (*whole)->channels())
    if (channel.topic == "lab/lever/sampled") chosen.push_back(number);
  const auto count = capture::cut(file_, part_, {.from_ns = kCutNs, .channel_ids = chosen});
  ASSERT_TRUE(count) << count.error().text();
  EXPECT_EQ(*count, 100u);
}

TEST_F(CutFromTheMiddle, IsAsItWasFromTheBegin) {
  const std::uint64_t to_ns = RunWriter::kBeginNs + 99'000'000;
  const auto count = capture::cut(file_, part_, {.to_ns = to_ns});
  ASSERT_TRUE(count) << count.error().text();
  EXPECT_EQ(*count, 11u) << "description and samples";
}

}  // namespace
}  // namespace rtpm::replay
