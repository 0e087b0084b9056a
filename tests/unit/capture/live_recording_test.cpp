#include "rtpm/capture/live_recording.hpp"

#include <device_events.rtpm.events.hpp>
#include <trial.rtpm.events.hpp>

#include "../recording/recorded.hpp"
#include "rtpm/capture/channels.hpp"
#include "rtpm/capture/read_events.hpp"
#include "rtpm/events/hub_server.hpp"
#include "rtpm/events/trials.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/utc.hpp"
#include "rtpm/test/os.hpp"

// A program that records the events of a hub itself, and reads them back.
namespace rtpm::capture {
namespace {

class LiveRecordingTest : public testing::Test {
 protected:
  void SetUp() override {
    auto served = events::HubServer::create(node_, {.name = ""});
    ASSERT_TRUE(served) << served.error().text();
    hub_ = std::move(*served);
    auto started = LiveRecording::start(node_, file_, {.hub = hub_->url()});
    ASSERT_TRUE(started) << started.error().text();
    recording_ = std::move(*started);
  }
  [[nodiscard]] std::unique_ptr<recording::FileReader> stopped() {
    EXPECT_TRUE(recording_->stop());
    auto reader = recording::FileReader::open(file_);
    EXPECT_TRUE(reader);
    return reader ? std::move(*reader) : nullptr;
  }

  recording::Folder folder_;
  std::string file_ = folder_.fresh("live");
  rpc::Node node_{{.default_deadline = std::chrono::seconds{5}}};
  std::unique_ptr<events::HubServer> hub_;
  std::unique_ptr<LiveRecording> recording_;
};

TEST_F(LiveRecordingTest, HasTheTrialsOfAnExperiment) {
  auto trials = events::TrialSupplier::create(node_, hub_->url(), 4);
  ASSERT_TRUE(trials) << trials.error().text();
  using enum events::TrialPhase;
  ASSERT_TRUE(trials->push({.phase = kBegin, .number = 3, .condition = "soft"}));
  ASSERT_TRUE(trials->push({.number = 3, .note = "touches"}));
  ASSERT_TRUE(trials->push({.phase = kEnd,
                            .number = 3,
                            .condition = "soft",
                            .response = "first",
                            .seed = 0,
                            .duration = std::chrono::seconds{2}}));
  ASSERT_TRUE(test::await([&] { return recording_->status().recorder.message_count == 3; }));
  const auto reader = stopped();
  ASSERT_NE(reader, nullptr);
  std::vector<TrialT> read;
  ASSERT_TRUE(read_events<TrialEvent>(*reader, [&](const auto& event) {
    EXPECT_EQ(event.channel.topic, "rtpm.Trial/4");
    event.payload.UnPackTo(&read.emplace_back());
    return true;
  }));
  ASSERT_EQ(read.size(), 3u);
  EXPECT_EQ(read[0].phase, TrialPhase::Begin);
  EXPECT_EQ(read[0].condition, "soft");
  EXPECT_FALSE(read[0].seed.has_value()) << "no seed is not seed 0";
  EXPECT_EQ(read[1].phase, TrialPhase::Mark);
  EXPECT_EQ(read[1].note, "touches");
  EXPECT_EQ(read[2].number, 3u);
  EXPECT_EQ(read[2].response, "first");
  EXPECT_EQ(read[2].seed, 0u);
  EXPECT_EQ(read[2].duration_ns, 2'000'000'000u);
}

TEST_F(LiveRecordingTest, HasTheOffsetsOfTheClocks) {
  ASSERT_TRUE(
      test::await([&] { return recording_->status().time > std::chrono::milliseconds{1}; }));
  const auto reader = stopped();
  ASSERT_NE(reader, nullptr);
  const auto metadata = reader->read_metadata();
  ASSERT_TRUE(metadata);
  std::vector<std::string> times;
  for (const recording::Metadata& one : *metadata) {
    if (one.name != "rtpm.clocks") continue;
    times.push_back(one.values.at("measured"));
    // The hub is in this program: one clock.
    const std::int64_t uncertainty_ns = std::stoll(one.values.at(hub_->url() + "/uncertainty_ns"));
    EXPECT_GE(uncertainty_ns, 0);
    EXPECT_LE(std::abs(std::stoll(one.values.at(hub_->url() + "/offset_ns"))), uncertainty_ns);
    const std::int64_t to_utc_ns = std::stoll(one.values.at("log_time_minus_monotonic_ns"));
    EXPECT_NEAR(static_cast<double>(to_utc_ns),
                static_cast<double>(rt::utc_ns(rt::now())) - static_cast<double>(to_ns(rt::now())),
                5e9);
  }
  EXPECT_EQ(times, (std::vector<std::string>{"begin", "end"}));
}

TEST_F(LiveRecordingTest, HasTheEventsOfLaterSuppliersByType) {
  auto supplier = device::StopAllRequestedSupplier::create(hub_->hub(), 3);
  ASSERT_TRUE(supplier) << supplier.error().text();
  for (std::uint64_t i = 1; i <= 5; ++i)
    ASSERT_TRUE(supplier->push(device::StopAll(i)));
  ASSERT_TRUE(test::await([&] { return recording_->status().recorder.message_count == 5; }));
  const auto reader = stopped();
  ASSERT_NE(reader, nullptr);
  std::vector<std::uint64_t> ids;
  const auto read = read_events<device::StopAllRequestedEvent>(*reader, [&](const auto& event) {
    EXPECT_EQ(event.channel.topic, "rtpm.device.StopAllRequested/3");
    ids.push_back(event.payload.id());
    return ids.size() < 4;
  });
  ASSERT_TRUE(read) << read.error().text();
  EXPECT_EQ(ids, (std::vector<std::uint64_t>{1, 2, 3, 4}));
  const auto none = read_events<device::SampledEvent>(*reader, [](const auto&) { return true; });
  ASSERT_FALSE(none);
  EXPECT_NE(none.error().text().find("no event rtpm.device.Sampled"), std::string::npos);
}

TEST_F(LiveRecordingTest, HasRemarksAtTheirTime) {
  const std::uint64_t before_ns = rt::utc_ns(rt::now());
  EXPECT_TRUE(recording_->annotate("trial \"7\",\nleft hand"));
  const auto reader = stopped();
  ASSERT_NE(reader, nullptr);
  const auto messages = recording::read_all(*reader);
  ASSERT_EQ(messages.size(), 1u);
  EXPECT_EQ(reader->channels().at(messages[0].channel_id).topic, kAnnotationTopic);
  EXPECT_EQ(messages[0].text, R"({"text": "trial \"7\",\u000aleft hand"})");
  constexpr std::uint64_t kMinuteNs = 60'000'000'000;
  EXPECT_GT(messages[0].log_time_ns + kMinuteNs, before_ns);
  EXPECT_LT(messages[0].log_time_ns, before_ns + kMinuteNs);
}

TEST_F(LiveRecordingTest, IsRefusedWithoutAHub) {
  const std::string file = folder_.fresh("none");
  const auto started = LiveRecording::start(node_, file, {.hub = "rtpm://127.0.0.1:1/rtpm/events"});
  EXPECT_FALSE(started);
  EXPECT_FALSE(std::filesystem::exists(file));
}

}  // namespace
}  // namespace rtpm::capture
