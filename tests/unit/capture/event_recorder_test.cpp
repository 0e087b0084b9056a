#include "event_recorder.hpp"

#include <array>
#include <device_events.rtpm.events.hpp>

#include "../recording/recorded.hpp"
#include "rtpm/gvd/device_event.hpp"
#include "rtpm/rt/clock.hpp"

// The output of the event recorder, read back.
namespace rtpm::capture {
namespace {

constexpr std::array kKnown{&device::ButtonChangedEvent::kDescriptor};

class EventRecorderTest : public testing::Test {
 protected:
  void SetUp() override {
    auto created = recording::Recorder::create(file_);
    ASSERT_TRUE(created) << created.error().text();
    recorder_ = std::move(*created);
    events_.emplace(*recorder_);
  }
  /// A button's change from `source`; the hub's clock is one second behind this host's.
  void record(events::SourceId source, std::uint64_t sequence, bool is_known = true,
              bool is_hub_local = false) {
    const device::ButtonChange change(sequence, 2, true);
    const MonotonicTime now = rt::now() - std::chrono::seconds{1};
    const auto* const bytes = reinterpret_cast<const std::byte*>(&change);
    events_->record({.header = {.type = 1380974594,
                                .source = source,
                                .sequence = sequence,
                                .origin = now - std::chrono::milliseconds{5},
                                .hub_received = now,
                                .hub_sent = now},
                     .payload = {bytes, sizeof change}},
                    is_known ? &device::ButtonChangedEvent::kDescriptor : nullptr, is_hub_local);
  }
  [[nodiscard]] std::unique_ptr<recording::FileReader> closed() {
    EXPECT_TRUE(recorder_->close());
    auto reader = recording::FileReader::open(file_);
    EXPECT_TRUE(reader);
    return reader ? std::move(*reader) : nullptr;
  }

  recording::Folder folder_;
  std::string file_ = folder_.fresh("events");
  std::unique_ptr<recording::Recorder> recorder_;
  std::optional<EventRecorder> events_;
};

TEST_F(EventRecorderTest, HasAChannelPerTypeAndSource) {
  for (std::uint64_t i = 1; i <= 3; ++i) {
    record(3, i);
    record(4, 10 + i);
  }
  const auto reader = closed();
  ASSERT_NE(reader, nullptr);
  ASSERT_EQ(reader->channels().size(), 2u);
  EXPECT_EQ(reader->channels().at(1).topic, "rtpm.device.ButtonChanged/3");
  EXPECT_EQ(reader->channels().at(2).topic, "rtpm.device.ButtonChanged/4");
  EXPECT_EQ(reader->channels().at(2).metadata.at("rtpm.source"), "4");
  ASSERT_EQ(reader->schemas().size(), 1u);
  EXPECT_EQ(reader->schemas().at(1).name, "rtpm.device.ButtonChanged");
  const auto messages = recording::read_all(*reader, {.channel_ids = {2}});
  ASSERT_EQ(messages.size(), 3u);
  EXPECT_EQ(messages[2].sequence, 13u);
}

TEST_F(EventRecorderTest, KeepsTheOriginAsPublishTime) {
  record(3, 7);
  const auto reader = closed();
  ASSERT_NE(reader, nullptr);
  static_cast<void>(reader->read({}, [](const recording::Message& message) {
    EXPECT_EQ(message.log_time_ns - message.publish_time_ns, 5'000'000u);
    return true;
  }));
}

TEST_F(EventRecorderTest, KeepsTheExactOriginOfAHubOnThisHost) {
  record(3, 7, /*is_known=*/false, /*is_hub_local=*/true);
  record(3, 8, /*is_known=*/true, /*is_hub_local=*/true);
  const auto reader = closed();
  ASSERT_NE(reader, nullptr);
  int count = 0;
  EXPECT_TRUE(reader->read({}, [&](const recording::Message& message) {
    EXPECT_GE(message.log_time_ns - message.publish_time_ns, 1'005'000'000u);
    ++count;
    return true;
  }));
  EXPECT_EQ(count, 2);
}

/// A program's first events may arrive before the hub has announced its types.
TEST_F(EventRecorderTest, HoldsEventsBackUntilTheirTypeIsKnown) {
  record(3, 1, /*is_known=*/false);
  record(3, 2, /*is_known=*/false);
  EXPECT_TRUE(events_->is_holding());
  record(3, 3);
  EXPECT_FALSE(events_->is_holding());
  const auto reader = closed();
  ASSERT_NE(reader, nullptr);
  ASSERT_EQ(reader->channels().size(), 1u);
  EXPECT_EQ(reader->channels().at(1).topic, "rtpm.device.ButtonChanged/3");
  EXPECT_EQ(reader->channels().at(1).message_encoding, "flatbuffer");
  const auto messages = recording::read_all(*reader);
  ASSERT_EQ(messages.size(), 3u);
  for (std::uint32_t i = 0; i < 3; ++i)
    EXPECT_EQ(messages[i].sequence, i + 1);
}

TEST_F(EventRecorderTest, RecordsHeldEventsWhenTheirTypeIsLearned) {
  record(3, 1, /*is_known=*/false);
  events_->attend({});
  EXPECT_TRUE(events_->is_holding()) << "it waits on";
  events_->attend(kKnown);
  EXPECT_FALSE(events_->is_holding());
  const auto reader = closed();
  ASSERT_NE(reader, nullptr);
  EXPECT_EQ(reader->channels().at(1).topic, "rtpm.device.ButtonChanged/3");
}

TEST_F(EventRecorderTest, HoldsEventsBackUntilTheirDeviceIsNamed) {
  events_.emplace(*recorder_, /*names_devices=*/true);
  const events::SourceId source = gvd::source_of("lab/arm0");
  record(source, 1);
  EXPECT_TRUE(events_->take_new_unnamed());
  EXPECT_TRUE(events_->take_new_unnamed()) << "while it waits";
  const std::vector<std::string> names{"lab/arm0"};
  events_->name_devices(names);
  EXPECT_FALSE(events_->take_new_unnamed());
  events_->attend(kKnown);
  EXPECT_EQ(events_->take_new_devices(), names);
  const auto reader = closed();
  ASSERT_NE(reader, nullptr);
  ASSERT_EQ(reader->channels().size(), 1u);
  EXPECT_EQ(reader->channels().at(1).topic, "lab/arm0/button_changed");
}

TEST_F(EventRecorderTest, RecordsUnknownTypesByNumber) {
  record(3, 1, /*is_known=*/false);
  events_->finish({});
  record(3, 2, /*is_known=*/false);
  EXPECT_FALSE(events_->is_holding()) << "it has waited in vain";
  record(3, 3);
  const auto reader = closed();
  ASSERT_NE(reader, nullptr);
  ASSERT_EQ(reader->channels().size(), 2u);
  EXPECT_EQ(reader->channels().at(1).topic, "1380974594/3");
  EXPECT_EQ(reader->channels().at(1).message_encoding, "");
  EXPECT_EQ(reader->channels().at(2).message_encoding, "flatbuffer");
  const auto messages = recording::read_all(*reader, {.channel_ids = {1}});
  ASSERT_EQ(messages.size(), 2u);
  EXPECT_EQ(messages[0].text.size(), sizeof(device::ButtonChange));
}

TEST_F(EventRecorderTest, HoldsEventsUpToTheCapacityOfItsTrack) {
  constexpr std::uint64_t kCount = 100'000;
  for (std::uint64_t i = 1; i <= kCount; ++i)
    record(3, i, /*is_known=*/false);
  EXPECT_FALSE(events_->is_holding());
}

}  // namespace
}  // namespace rtpm::capture
