#include "rtpm/recording/recorder.hpp"

#include <thread>

#include "recorded.hpp"
#include "rtpm/recording/repair.hpp"
#include "rtpm/rt/clock.hpp"

// Recording from real-time threads, which only copy the messages.
namespace rtpm::recording {
namespace {

using namespace std::chrono_literals;

const RecorderConfig kSmall{.message_byte_max = 1000, .ring_byte_count = 4096};

class RealtimeRecording : public testing::Test {
 protected:
  Folder folder_;
  std::string path_ = folder_.fresh("file");
};

std::uint16_t channel_of(Recorder& recorder, const std::string& topic) {
  const auto channel = recorder.add_channel({.topic = topic, .message_encoding = "json"});
  EXPECT_TRUE(channel);
  return channel.value_or(0);
}

/// Puts `count` messages, retrying each until the ring takes it. @return the number of retries
std::uint64_t put_all(Recorder::Track& track, std::uint16_t channel, std::uint32_t count) {
  std::uint64_t drop_count = 0;
  for (std::uint32_t i = 0; i < count; ++i) {
    const std::string text = "{\"number\": " + std::to_string(i) + "}";
    while (!track.put({.channel_id = channel,
                       .sequence = i,
                       .log_time_ns = i + 1,
                       .publish_time_ns = i,
                       .data = bytes_of(text)})) {
      ++drop_count;
      std::this_thread::sleep_for(1ms);
    }
  }
  return drop_count;
}

TEST_F(RealtimeRecording, KeepsTheMessagesOfSeveralThreads) {
  constexpr std::uint32_t kCount = 20'000;
  auto recorder = Recorder::create(path_);
  ASSERT_TRUE(recorder) << recorder.error().text();
  std::vector<std::uint16_t> channels;
  {
    std::vector<std::jthread> threads;
    for (const char* topic : {"a", "b", "c"}) {
      channels.push_back(channel_of(**recorder, topic));
      Recorder::Track& track = (*recorder)->add_track();
      threads.emplace_back(
          [&track, channel = channels.back()] { EXPECT_EQ(put_all(track, channel, kCount), 0u); });
    }
  }
  ASSERT_TRUE((*recorder)->close());
  EXPECT_EQ((*recorder)->status().message_count, 3 * kCount);
  auto reader = FileReader::open(path_);
  ASSERT_TRUE(reader) << reader.error().text();
  for (const std::uint16_t channel : channels) {
    const auto messages = read_all(**reader, {.channel_ids = {channel}});
    ASSERT_EQ(messages.size(), kCount);
    for (std::uint32_t i = 0; i < kCount; ++i) {
      ASSERT_EQ(messages[i].sequence, i);
      ASSERT_EQ(messages[i].text, "{\"number\": " + std::to_string(i) + "}");
    }
  }
  EXPECT_EQ(*check(path_), std::vector<std::string>{});
}

TEST_F(RealtimeRecording, CountsDropsAlsoInTheFile) {
  constexpr std::uint32_t kCount = 5'000;
  auto recorder = Recorder::create(path_, kSmall);
  ASSERT_TRUE(recorder) << recorder.error().text();
  const std::uint16_t channel = channel_of(**recorder, "a");
  Recorder::Track& track = (*recorder)->add_track();
  const std::vector<std::byte> payload(900);
  std::uint64_t drop_count = 0;
  for (std::uint32_t i = 0; i < kCount; ++i) {
    const Message message{.channel_id = channel, .log_time_ns = i, .data = payload};
    if (!track.put(message)) ++drop_count;
  }
  const std::vector<std::byte> too_long(1001);
  EXPECT_FALSE(track.put({.channel_id = channel, .data = too_long}));
  ++drop_count;
  ASSERT_TRUE((*recorder)->close());
  const RecorderStatus status = (*recorder)->status();
  EXPECT_GT(drop_count, 100u) << "this tries nothing";
  EXPECT_EQ(status.drop_count, drop_count);
  EXPECT_EQ(status.message_count + drop_count, kCount + 1);
  auto reader = FileReader::open(path_);
  ASSERT_TRUE(reader);
  const auto metadata = (*reader)->read_metadata();
  ASSERT_TRUE(metadata);
  ASSERT_FALSE(metadata->empty());
  EXPECT_EQ(metadata->back().name, "rtpm.recorder");
  EXPECT_EQ(metadata->back().values.at("dropped." + std::to_string(channel)),
            std::to_string(drop_count));
}

TEST_F(RealtimeRecording, HasTimesThatDoNotGoBack) {
  auto recorder = Recorder::create(path_);
  ASSERT_TRUE(recorder);
  const MonotonicTime now = rt::now();
  const std::uint64_t ns = (*recorder)->log_time_ns(now);
  const std::int64_t wall_s = ::time(nullptr);
  EXPECT_LE(std::abs(static_cast<std::int64_t>(ns / 1'000'000'000) - wall_s), 2);
  EXPECT_EQ((*recorder)->log_time_ns(now + 5s), ns + 5'000'000'000);
}

}  // namespace
}  // namespace rtpm::recording
