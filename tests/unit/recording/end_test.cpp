#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <random>
#include <thread>

#include "recorded.hpp"
#include "rtpm/recording/recorder.hpp"
#include "rtpm/recording/repair.hpp"
#include "rtpm/test/os.hpp"

// Recordings that end by a full disk or a killed program.
namespace rtpm::recording {
namespace {

using namespace std::chrono_literals;

class EndedRecording : public testing::Test {
 protected:
  Folder folder_;
  std::string path_ = folder_.fresh("file");
};

std::uint16_t channel_of(Recorder& recorder, const std::string& topic) {
  const auto channel = recorder.add_channel({.topic = topic, .message_encoding = "json"});
  EXPECT_TRUE(channel);
  return channel.value_or(0);
}

/// A limit of the file's size stands in for a full disk; its signal does not end the program.
TEST_F(EndedRecording, StaysReadableWhenTheDiskIsFull) {
  rlimit before{};
  ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &before), 0);
  const rlimit limit{.rlim_cur = 20'000, .rlim_max = before.rlim_max};
  expected<void, SetupError> written{};
  std::uint32_t count = 0;
  {
    auto writer =
        FileWriter::create(path_, {.compression = Compression::kNone, .chunk_byte_max = 1000});
    ASSERT_TRUE(writer);
    const auto channel = (*writer)->add_channel({.topic = "a", .message_encoding = "json"});
    ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &limit), 0);
    while (written && count < 10'000) {
      written = (*writer)->write({.channel_id = *channel,
                                  .sequence = count++,
                                  .log_time_ns = count,
                                  .data = bytes_of("{}")});
    }
    const auto again = (*writer)->write(Metadata{.name = "later"});
    EXPECT_FALSE(again) << "no part may follow that lacks the one before";
    EXPECT_FALSE((*writer)->close());
  }
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &before), 0);
  ASSERT_FALSE(written);
  EXPECT_NE(written.error().text().find("make room"), std::string::npos) << written.error().text();
  EXPECT_FALSE(FileReader::open(path_)) << "it was not ended";
  auto reader = FileReader::open(path_, Incomplete::kRead);
  ASSERT_TRUE(reader) << reader.error().text();
  const std::size_t read_count = read_all(**reader).size();
  EXPECT_GT(read_count, 300u);
  EXPECT_GE(read_count + 40, count) << "at most a chunk is lost";
}

TEST_F(EndedRecording, KeepsItsMessagesAndReportsWhenTheDiskIsFull) {
  rlimit before{};
  ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &before), 0);
  const rlimit limit{.rlim_cur = 50'000, .rlim_max = before.rlim_max};
  RecorderConfig config;
  config.writer = {.compression = Compression::kNone, .chunk_byte_max = 4000};
  auto recorder = Recorder::create(path_, config);
  ASSERT_TRUE(recorder);
  const std::uint16_t channel = channel_of(**recorder, "a");
  Recorder::Track& track = (*recorder)->add_track();
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &limit), 0);
  const std::vector<std::byte> payload(1000);
  for (std::uint32_t i = 0; i < 1'000; ++i)
    static_cast<void>(track.put({.channel_id = channel, .log_time_ns = i, .data = payload}));
  const auto closed = (*recorder)->close();
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &before), 0);
  ASSERT_FALSE(closed);
  EXPECT_NE(closed.error().text().find(path_), std::string::npos) << closed.error().text();
  const RecorderStatus status = (*recorder)->status();
  ASSERT_TRUE(status.problem);
  EXPECT_GT(status.drop_count, 900u);
  auto reader = FileReader::open(path_, Incomplete::kRead);
  ASSERT_TRUE(reader) << reader.error().text();
  EXPECT_GT(read_all(**reader).size(), 30u);
}

/// A child process that records 10 messages each millisecond until it is killed.
pid_t record_in_child(const std::string& path) {
  const pid_t child = ::fork();
  if (child != 0) return child;
  auto recorder = Recorder::create(path, {.writer = {.chunk_byte_max = 2'000}});
  if (!recorder) ::_exit(1);
  const auto channel = (*recorder)->add_channel({.topic = "a", .message_encoding = "json"});
  Recorder::Track& track = (*recorder)->add_track();
  for (std::uint32_t i = 0;; ++i) {
    const std::string text = std::to_string(i);
    static_cast<void>(track.put(
        {.channel_id = *channel, .sequence = i, .log_time_ns = i + 1, .data = bytes_of(text)}));
    if (i % 10 == 9) std::this_thread::sleep_for(1ms);
  }
}

TEST_F(EndedRecording, RecoversUpToTheLastChunkOfAKilledProgram) {
  const char* const count = std::getenv("RTPM_KILL_COUNT");
  const int kill_count = count == nullptr ? 10 : std::atoi(count);
  std::mt19937 random(27);
  std::uint64_t recovered_count = 0;
  for (int round = 0; round < kill_count; ++round) {
    const std::string path = folder_.fresh("killed");
    const pid_t child = record_in_child(path);
    ASSERT_GT(child, 0);
    // On a busy machine the child begins late.
    ASSERT_TRUE(rtpm::test::await([&] {
      std::error_code missing;
      return std::filesystem::file_size(path, missing) > 0 && !missing;
    }));
    std::this_thread::sleep_for(std::chrono::microseconds{20'000 + random() % 80'000});
    ::kill(child, SIGKILL);
    int state = 0;
    ASSERT_EQ(::waitpid(child, &state, 0), child);
    ASSERT_TRUE(WIFSIGNALED(state)) << "round " << round;
    const std::string saved = folder_.fresh("saved");
    const auto recovery = recover(path, saved);
    ASSERT_TRUE(recovery) << recovery.error().text();
    EXPECT_EQ(recovery->damaged_chunk_count, 0u) << "round " << round;
    auto reader = FileReader::open(saved);
    ASSERT_TRUE(reader) << reader.error().text();
    const auto messages = read_all(**reader);
    // There is no gap: only the end is lost.
    for (std::uint32_t i = 0; i < messages.size(); ++i)
      ASSERT_EQ(messages[i].sequence, i) << "round " << round;
    recovered_count += messages.size();
  }
  EXPECT_GT(recovered_count, 50u * static_cast<unsigned>(kill_count));
}

}  // namespace
}  // namespace rtpm::recording
