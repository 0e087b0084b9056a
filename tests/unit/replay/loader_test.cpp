#include <gtest/gtest.h>

#include <algorithm>

#include "recorded_run.hpp"

// Recordings, valid and odd, loaded for playing.
namespace rtpm::replay {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

class Loading : public testing::Test {
 protected:
  /// Loads the recording; the test fails on a refusal.
  [[nodiscard]] Recorded loaded(const Selection& selection = {}) {
    auto recorded = load(file_, selection);
    EXPECT_TRUE(recorded) << recorded.error().text();
    return recorded ? std::move(*recorded) : Recorded{};
  }
  [[nodiscard]] std::string refusal(const Selection& selection = {}) {
    const auto recorded = load(file_, selection);
    EXPECT_FALSE(recorded);
    return recorded ? "" : recorded.error().text();
  }
  /// Writes a lever with samples at these milliseconds.
  void write(const std::vector<std::int64_t>& times_ms) {
    RunWriter writer(file_);
    writer.describe("lab/lever");
    const auto channel = writer.add_samples("lab/lever");
    std::uint64_t sequence = 100;
    for (const std::int64_t at_ms : times_ms)
      writer.put_sample(channel, sequence++, at_ms);
    writer.close();
  }
  static bool has_note(const Recorded& recorded, std::string_view words) {
    return std::ranges::any_of(recorded.notes, [&](const std::string& note) {
      return note.find(words) != std::string::npos;
    });
  }

  recording::Folder folder_;
  std::string file_ = folder_.fresh("run");
};

TEST_F(Loading, FindsDevicesAndTheirSamplesBitByBit) {
  write({10, 11, 12});
  const Recorded recorded = loaded();
  ASSERT_EQ(recorded.devices.size(), 1u);
  EXPECT_EQ(recorded.devices[0].name, "lab/lever");
  EXPECT_EQ(recorded.devices[0].description, description_of(test::ScriptedDriver{}.descriptor));
  ASSERT_EQ(recorded.devices[0].samples.size(), 3u);
  for (std::size_t i = 0; i < 3; ++i)
    EXPECT_EQ(bytes_of(recorded.devices[0].samples[i]), bytes_of(sample_of(100 + i)));
  EXPECT_EQ(recorded.devices[0].times,
            (std::vector<Duration>{milliseconds{0}, milliseconds{1}, milliseconds{2}}));
  EXPECT_EQ(recorded.length, milliseconds{2});
  EXPECT_TRUE(recorded.notes.empty()) << recorded.notes.front();
}

TEST_F(Loading, KeepsThePayloadsOfEventsAsTheyWerePushed) {
  write({10, 11});
  const Recorded recorded = loaded();
  ASSERT_EQ(recorded.events.size(), 2u);
  const RecordedEvent& event = recorded.events[1];
  ASSERT_EQ(event.size, sizeof(device::Sample));
  const device::Sample sample = sample_of(101);
  EXPECT_EQ(std::memcmp(recorded.payloads.data() + event.offset, &sample, sizeof sample), 0);
  EXPECT_EQ(recorded.sources[0].source, gvd::source_of("lab/lever"));
  EXPECT_EQ(recorded.sources[0].type, gvd::kSampled);
  EXPECT_EQ(recorded.sources[0].schema_id, device::SampledEvent::kSchemaId);
}

TEST_F(Loading, PlaysPolledSamplesWithoutPushingThem) {
  RunWriter writer(file_);
  writer.describe("lab/lever");
  writer.put_sample(writer.add_samples("lab/lever", capture::kSampleKind), 100, 1);
  writer.close();
  const Recorded recorded = loaded();
  EXPECT_EQ(recorded.devices.at(0).samples.size(), 1u);
  EXPECT_TRUE(recorded.events.empty());
}

TEST_F(Loading, TakesPushedSamplesWhereThereArePolledOnesToo) {
  RunWriter writer(file_);
  writer.describe("lab/lever");
  const auto polled = writer.add_samples("lab/lever", capture::kSampleKind);
  const auto pushed = writer.add_samples("lab/lever");
  writer.put_sample(polled, 101, 1);
  for (std::uint64_t i = 0; i < 3; ++i)
    writer.put_sample(pushed, 100 + i, static_cast<std::int64_t>(i));
  writer.close();
  EXPECT_EQ(loaded().devices.at(0).samples.size(), 3u);
}

TEST_F(Loading, ReadsAPart) {
  write({0, 10, 20, 30});
  const Recorded recorded = loaded({.from = milliseconds{5}, .to = milliseconds{25}});
  ASSERT_EQ(recorded.devices.at(0).samples.size(), 2u);
  EXPECT_EQ(recorded.devices[0].samples[0].sequence(), 101u);
  EXPECT_EQ(recorded.devices[0].times[1], milliseconds{10});
}

TEST_F(Loading, RefusesAnotherVersionAndNamesBoth) {
  RunWriter writer(file_);
  writer.describe("lab/lever");
  writer.put_sample(writer.add_samples("lab/lever", capture::kEventKind, 0xabcd), 100, 1);
  writer.close();
  const std::string text = refusal();
  EXPECT_NE(text.find("rtpm.device.Sampled"), std::string::npos) << text;
  EXPECT_NE(text.find("000000000000abcd"), std::string::npos) << text;
  char here[17] = {};
  std::snprintf(here, sizeof here, "%016llx",
                static_cast<unsigned long long>(device::SampledEvent::kSchemaId));
  EXPECT_NE(text.find(here), std::string::npos) << text;
}

TEST_F(Loading, RefusesADescriptionOfAnotherVersion) {
  RunWriter writer(file_);
  writer.describe("lab/lever", 0x1234);
  writer.close();
  EXPECT_NE(refusal().find("rtpm.device.Device"), std::string::npos) << refusal();
}

TEST_F(Loading, LeavesBrokenSamplesOut) {
  RunWriter writer(file_);
  writer.describe("lab/lever");
  const auto channel = writer.add_samples("lab/lever");
  writer.put_sample(channel, 100, 1);
  for (const std::size_t size : {0u, 3u, 8u, 40u})
    writer.put(channel, 101, 2, std::vector<std::byte>(size, std::byte{0xff}));
  writer.put_sample(channel, 102, 3);
  writer.close();
  const Recorded recorded = loaded();
  EXPECT_EQ(recorded.devices.at(0).samples.size(), 2u);
  EXPECT_TRUE(has_note(recorded, "4 messages are broken"));
}

TEST_F(Loading, LeavesOutWhatViewersDraw) {
  RunWriter writer(file_);
  writer.describe("lab/lever");
  const auto samples = writer.add_samples("lab/lever");
  const auto pose = writer.add_channel("lab/lever/pose", {{capture::kKindKey, capture::kViewKind},
                                                          {capture::kDeviceKey, "lab/lever"}});
  writer.put_sample(samples, 100, 1);
  writer.put(pose, 100, 1, std::vector<std::byte>(8, std::byte{0xff}));
  writer.put_sample(samples, 101, 2);
  writer.close();
  const Recorded recorded = loaded();
  EXPECT_EQ(recorded.devices.at(0).samples.size(), 2u);
  EXPECT_EQ(recorded.sources.size(), 1u);  // The samples.
  EXPECT_TRUE(recorded.notes.empty()) << recorded.notes.front();
}

TEST_F(Loading, LeavesADeviceWithABrokenDescriptionOut) {
  RunWriter writer(file_);
  const auto description = writer.add_channel(
      "lab/lever/description",
      {{capture::kKindKey, capture::kDescriptionKind},
       {capture::kDeviceKey, "lab/lever"},
       {capture::kSchemaIdKey, std::to_string(device::DeviceClient::interface().fingerprint)}});
  writer.put(description, 0, 0, std::vector<std::byte>(100, std::byte{0x7f}));
  writer.put_sample(writer.add_samples("lab/lever"), 100, 1);
  writer.close();
  const Recorded recorded = loaded();
  EXPECT_TRUE(recorded.devices.empty());
  EXPECT_EQ(recorded.events.size(), 1u) << "its events are events still";
  EXPECT_TRUE(has_note(recorded, "description is broken"));
}

TEST_F(Loading, ShortensAPauseInWhichTheClockLeapt) {
  write({0, 1, 600'001, 600'002});
  const Recorded recorded = loaded();
  EXPECT_EQ(recorded.devices.at(0).times,
            (std::vector<Duration>{milliseconds{0}, milliseconds{1}, milliseconds{1001},
                                   milliseconds{1002}}));
  EXPECT_TRUE(has_note(recorded, "nothing was recorded for 600.000 s after 0.001 s"));
}

TEST_F(Loading, ReportsThatTheClockWentBack) {
  // Once sorted by time, the sequence numbers go backwards.
  write({100, 101, 102, 50, 51});
  const Recorded recorded = loaded();
  EXPECT_EQ(recorded.devices.at(0).samples.size(), 5u);
  EXPECT_TRUE(std::ranges::is_sorted(recorded.devices[0].times));
  EXPECT_TRUE(has_note(recorded, "sequence numbers go back 1 times"));
}

/// Other writers' clocks may have any 64-bit value.
TEST_F(Loading, TakesStampsAtTheEndOfTime) {
  RunWriter writer(file_, UINT64_MAX - 2'000'000);
  writer.describe("lab/lever");
  const auto channel = writer.add_samples("lab/lever");
  for (std::int64_t i = 0; i < 3; ++i)
    writer.put_sample(channel, static_cast<std::uint64_t>(100 + i), i);
  writer.close();
  const Recorded recorded = loaded({.to = seconds{10}});
  ASSERT_EQ(recorded.devices.at(0).times.size(), 3u) << "the end of a part is no earlier";
  EXPECT_EQ(recorded.length, milliseconds{2});
  EXPECT_TRUE(recorded.notes.empty()) << recorded.notes.front();
}

TEST_F(Loading, PlaysAJumpFromTheBeginningToTheEndOfTimeAsAPause) {
  RunWriter writer(file_, 0);
  writer.describe("lab/lever");
  const auto channel = writer.add_samples("lab/lever");
  writer.put_sample_at(channel, 100, 0);
  writer.put_sample_at(channel, 101, UINT64_MAX / 2);
  writer.put_sample_at(channel, 102, UINT64_MAX);
  writer.close();
  const Recorded recorded = loaded();
  EXPECT_LE(recorded.length, 2 * kPauseLeft);
  EXPECT_TRUE(has_note(recorded, "the clock leapt"));
}

}  // namespace
}  // namespace rtpm::replay
