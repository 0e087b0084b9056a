#include "rtpm/recording/repair.hpp"

#include <random>

#include "recorded.hpp"
#include "rtpm/recording/notes.hpp"

namespace rtpm::recording {
namespace {

constexpr int kMessageCount = 60;
constexpr std::size_t kMessagesPerChunk = 12;

class Repair : public testing::Test {
 protected:
  /// A small recording with several chunks.
  [[nodiscard]] std::string write_recording(Compression compression = Compression::kZstd) const {
    const std::string path = folder_.fresh("whole");
    auto writer = FileWriter::create(path, {.compression = compression, .chunk_byte_max = 400});
    EXPECT_TRUE(writer);
    write_messages(**writer, kMessageCount);
    EXPECT_TRUE((*writer)->write(Metadata{.name = "end"}));
    EXPECT_TRUE((*writer)->close());
    return path;
  }
  [[nodiscard]] static std::uint64_t lost_count(const Recovery& recovery) {
    std::uint64_t count = 0;
    for (const auto& [topic, lost] : recovery.lost_counts)
      count += lost;
    return count;
  }
  /// Expects that only write_recording()'s first chunk is lost.
  void expect_loss_of_first_chunk(const Recovery& recovery) const {
    EXPECT_EQ(recovery.damaged_chunk_count, 1u);
    EXPECT_EQ(recovery.unknown_channel_count, 0u);
    EXPECT_TRUE(recovery.untyped_topics.empty());
    EXPECT_TRUE(recovery.lost_counts.contains("lab/touched"));
    EXPECT_EQ(recovery.message_count + lost_count(recovery),
              static_cast<std::uint64_t>(kMessageCount));
    EXPECT_GE(recovery.message_count, kMessageCount - kMessagesPerChunk);
    auto reader = FileReader::open(folder_.path("recovered"));
    ASSERT_TRUE(reader) << reader.error().text();
    ASSERT_EQ((*reader)->channels().size(), 2u);
    const Channel& touched = (*reader)->channels().begin()->second;
    EXPECT_EQ(touched.topic, "lab/touched");
    EXPECT_EQ((*reader)->schemas().at(touched.schema_id).name, "lab.Touched");
    EXPECT_EQ(*check(folder_.path("recovered")), std::vector<std::string>{});
    const auto metadata = (*reader)->read_metadata();
    ASSERT_TRUE(metadata);
    EXPECT_EQ(metadata->back().name, kRecoveryMetadata);
    EXPECT_EQ(metadata->back().values.at("damaged_chunk_count"), "1");
    EXPECT_TRUE(metadata->back().values.contains("lost.lab/touched"));
  }
  Folder folder_;
};

TEST_F(Repair, RecoversWholeMessagesFromEachTruncation) {
  const std::string content = content_of(write_recording());
  const std::string cut = folder_.fresh("cut");
  const std::string recovered = folder_.fresh("recovered");
  std::uint64_t before_count = 0;
  for (std::size_t size = 8; size < content.size(); ++size) {
    put_content(cut, std::string_view(content).substr(0, size));
    std::filesystem::remove(recovered);
    const auto recovery = recover(cut, recovered);
    ASSERT_TRUE(recovery) << size << recovery.error().text();
    EXPECT_GE(recovery->message_count, before_count) << size;
    EXPECT_LE(recovery->message_count, before_count + kMessagesPerChunk) << size;
    before_count = recovery->message_count;
    if (size % 97 != 0) continue;
    EXPECT_EQ(*check(recovered), std::vector<std::string>{}) << size;
    EXPECT_NE(*check(cut), std::vector<std::string>{}) << size;
  }
  EXPECT_EQ(before_count, static_cast<std::uint64_t>(kMessageCount));
}

/// The chunk with the channels and schemas is damaged; the summary has them, too.
TEST_F(Repair, KeepsChannelsOfADamagedChunkThatTheSummaryHas) {
  const std::string content = content_of(write_recording(Compression::kNone));
  for (const char* place : {"message 2", "lab/touched"}) {
    std::string bytes = content;
    bytes[bytes.find(place)] ^= 1;
    const std::string damaged = folder_.fresh("damaged");
    put_content(damaged, bytes);
    const auto recovery = recover(damaged, folder_.fresh("recovered"));
    ASSERT_TRUE(recovery) << recovery.error().text();
    expect_loss_of_first_chunk(*recovery);
  }
}

/// The size of a chunk's record is damaged: the summary leads to the records behind it.
TEST_F(Repair, GoesOnBehindADamagedSize) {
  const std::string content = content_of(write_recording(Compression::kNone));
  const std::size_t header_size = 9 + static_cast<unsigned char>(content[9]);
  const std::size_t size_at = 8 + header_size + 1;
  ASSERT_EQ(content[size_at - 1], '\x06') << "the first chunk";
  for (const std::size_t byte : {0u, 1u, 3u, 7u}) {
    for (const int bit : {1, 128}) {
      std::string bytes = content;
      bytes[size_at + byte] = static_cast<char>(bytes[size_at + byte] ^ bit);
      const std::string damaged = folder_.fresh("damaged");
      put_content(damaged, bytes);
      const auto recovery = recover(damaged, folder_.fresh("recovered"));
      ASSERT_TRUE(recovery) << recovery.error().text();
      // With one more byte the chunk is complete: the format allows bytes behind its fields.
      if (recovery->message_count == static_cast<std::uint64_t>(kMessageCount)) continue;
      expect_loss_of_first_chunk(*recovery);
    }
  }
}

TEST_F(Repair, CountsMessagesWithoutChannelOrSchema) {
  // Both the first chunk and the summary are damaged.
  std::string bytes = content_of(write_recording(Compression::kNone));
  bytes[bytes.find("lab/touched")] ^= 1;
  bytes[bytes.rfind("lab/touched")] ^= 1;
  const std::string damaged = folder_.fresh("damaged");
  put_content(damaged, bytes);
  const auto recovery = recover(damaged, folder_.fresh("recovered"));
  ASSERT_TRUE(recovery);
  EXPECT_EQ(recovery->message_count, 0u);
  EXPECT_EQ(recovery->unknown_channel_count + lost_count(*recovery),
            static_cast<std::uint64_t>(kMessageCount));
  EXPECT_EQ(recovery->lost_counts.count("channel 1"), 1u);
}

/// Every flipped bit is found: each byte is under a checksum or in a field that is compared.
TEST_F(Repair, FindsEachFlippedBit) {
  const std::string content = content_of(write_recording());
  const std::string damaged = folder_.fresh("damaged");
  for (std::size_t i = 0; i < content.size(); i += 3) {
    std::string bytes = content;
    bytes[i] = static_cast<char>(bytes[i] ^ (1 << (i % 8)));
    put_content(damaged, bytes);
    const auto problems = check(damaged);
    EXPECT_TRUE(!problems || !problems->empty()) << "byte " << i << " of " << content.size();
  }
}

TEST_F(Repair, SurvivesRandomDamage) {
  const std::string content = content_of(write_recording(Compression::kLz4));
  const std::string damaged = folder_.fresh("damaged");
  std::mt19937 random(1);
  for (int trial = 0; trial < 1000; ++trial) {
    std::string bytes = content.substr(0, 8 + random() % (content.size() - 8));
    for (std::size_t flips = random() % 8; flips > 0; --flips)
      bytes[8 + random() % (bytes.size() - 7) - 1] = static_cast<char>(random());
    put_content(damaged, bytes);
    for (const Incomplete incomplete : {Incomplete::kRefuse, Incomplete::kRead}) {
      auto reader = FileReader::open(damaged, incomplete);
      if (!reader) continue;
      static_cast<void>((*reader)->read({}, [](const Message&) { return true; }));
      static_cast<void>((*reader)->read_metadata());
      static_cast<void>((*reader)->read_attachments());
    }
    static_cast<void>(check(damaged));
    const auto recovery = recover(damaged, folder_.fresh("recovered"));
    EXPECT_TRUE(!recovery || recovery->message_count <= static_cast<std::uint64_t>(kMessageCount));
  }
}

TEST_F(Repair, CutsATimeAndAChannelAndKeepsTheRest) {
  const std::string from = write_recording();
  const std::string to = folder_.fresh("cut");
  auto whole = FileReader::open(from);
  ASSERT_TRUE(whole);
  const std::uint16_t touched = (*whole)->channels().begin()->first;
  const Query query{.from_ns = 10'000'000, .to_ns = 30'000'000, .channel_ids = {touched}};
  ASSERT_TRUE(write_notes(from, {{.time_ns = 10'000'000, .text = "in the part"},
                                 {.time_ns = 30'000'001, .text = "after it"}}));
  const auto count = cut(from, to, query);
  ASSERT_TRUE(count) << count.error().text();
  EXPECT_EQ(*read_notes(to), (std::vector<Note>{{.time_ns = 10'000'000, .text = "in the part"}}));
  auto part = FileReader::open(to);
  ASSERT_TRUE(part) << part.error().text();
  EXPECT_EQ(read_all(**part), read_all(**whole, query));
  EXPECT_EQ(*count, read_all(**part).size());
  ASSERT_EQ((*part)->channels().size(), 1u);
  EXPECT_EQ((*part)->channels().begin()->second.topic, "lab/touched");
  EXPECT_EQ((*part)->schemas().begin()->second.name, "lab.Touched");
  EXPECT_EQ(*(*part)->read_metadata(), (std::vector<Metadata>{{.name = "end"}}));
  EXPECT_EQ(*check(to), std::vector<std::string>{});
}

TEST_F(Repair, LeavesNoFileWhenStopped) {
  const std::string from = write_recording();
  const std::string to = folder_.fresh("stopped");
  const auto recovery =
      recover(from, to, [](std::uint64_t done, std::uint64_t whole) { return done < whole / 2; });
  ASSERT_FALSE(recovery);
  EXPECT_NE(recovery.error().text().find("it was stopped"), std::string::npos);
  EXPECT_FALSE(std::filesystem::exists(to));
  EXPECT_FALSE(std::filesystem::exists(to + ".part"));
}

TEST_F(Repair, OverwritesNothing) {
  const std::string from = write_recording();
  const auto recovery = recover(from, from);
  ASSERT_FALSE(recovery);
  EXPECT_NE(recovery.error().text().find("exists already"), std::string::npos);
  EXPECT_FALSE(cut(from, from, {}));
  EXPECT_EQ(*check(from), std::vector<std::string>{});
}

}  // namespace
}  // namespace rtpm::recording
