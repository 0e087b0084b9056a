#include "foreign.hpp"

#include <sys/stat.h>
#include <unistd.h>
#include <zstd.h>

#include "recorded.hpp"
#include "rtpm/recording/repair.hpp"

// Recordings of other writers: valid ones are read, harmful ones are rejected.
namespace rtpm::recording {
namespace {

using namespace std::string_literals;
using namespace foreign;

class Foreign : public testing::Test {
 protected:
  [[nodiscard]] std::string put(const std::string& content) const {
    std::string path = folder_.fresh("foreign");
    put_content(path, content);
    return path;
  }
  /// The reason why the file can't be opened or read.
  [[nodiscard]] static std::string refusal(const std::string& path) {
    const auto reader = FileReader::open(path, Incomplete::kRead);
    if (!reader) return reader.error().text();
    const auto read = (*reader)->read({}, [](const Message&) { return true; });
    return read ? "" : read.error().text();
  }
  Folder folder_;
};

/// Combines the same features as the format's own conformance set.
class Conformance : public Foreign, public testing::WithParamInterface<Content> {
 protected:
  void expect_content(const std::string& path, const std::string& name) {
    auto reader = FileReader::open(path);
    ASSERT_TRUE(reader) << name << ": " << reader.error().text();
    const Content& content = GetParam();
    const auto messages = read_all(**reader);
    ASSERT_EQ(messages.size(), static_cast<std::size_t>(content.message_count)) << name;
    for (std::size_t i = 0; i < messages.size(); ++i) {
      EXPECT_EQ(messages[i].sequence, i) << name;
      EXPECT_EQ(messages[i].text, "\x01\x02\x03") << name;
      const auto channel = (*reader)->channels().find(messages[i].channel_id);
      ASSERT_NE(channel, (*reader)->channels().end()) << name;
      EXPECT_EQ(channel->second.topic, "example") << name;
      EXPECT_EQ(channel->second.metadata.at("foo"), "bar") << name;
      const auto schema = (*reader)->schemas().find(channel->second.schema_id);
      EXPECT_EQ(schema != (*reader)->schemas().end(), content.has_schema) << name;
      if (content.has_schema) {
        EXPECT_EQ(schema->second.name, "Example") << name;
      }
    }
    const auto metadata = (*reader)->read_metadata();
    ASSERT_TRUE(metadata) << name;
    EXPECT_EQ(metadata->size(), content.has_metadata ? 1u : 0u) << name;
    const auto attachments = (*reader)->read_attachments();
    ASSERT_TRUE(attachments) << name;
    EXPECT_EQ(attachments->size(), content.has_attachment ? 1u : 0u) << name;
  }
};
INSTANTIATE_TEST_SUITE_P(Each, Conformance, testing::ValuesIn(kContents),
                         [](const auto& each) { return std::string(each.param.name); });

TEST_P(Conformance, ReadsEachCombinationOfFeatures) {
  for (unsigned features = 0; features < kFeatureEnd; ++features) {
    if (!is_combined(GetParam(), features)) continue;
    const std::string name = name_of(GetParam(), features);
    const std::string path = put(Vector(GetParam(), features).bytes());
    expect_content(path, name);
    EXPECT_EQ(*check(path), std::vector<std::string>{}) << name;
  }
}

TEST_P(Conformance, CopiesEachCombinationOfFeatures) {
  for (unsigned features = 0; features < kFeatureEnd; features += 3) {
    if (!is_combined(GetParam(), features)) continue;
    const std::string name = name_of(GetParam(), features);
    const std::string path = put(Vector(GetParam(), features).bytes());
    const auto recovery = recover(path, folder_.fresh("recovered"));
    ASSERT_TRUE(recovery) << name << recovery.error().text();
    EXPECT_TRUE(recovery->is_without_loss()) << name;
    expect_content(folder_.path("recovered"), name);
    ASSERT_TRUE(cut(path, folder_.fresh("cut"), {})) << name;
    expect_content(folder_.path("cut"), name);
  }
}

// ---- harmful recordings -------------------------------------------------------------------------

TEST_F(Foreign, FileIsRefusedWithoutWaitingUnlessRegular) {
  const std::string pipe = folder_.fresh("pipe");
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_NE(refusal(pipe).find("pipe"), std::string::npos) << refusal(pipe);
  EXPECT_FALSE(read_outline(pipe));
  EXPECT_FALSE(check(pipe));
  EXPECT_FALSE(recover(pipe, folder_.fresh("recovered")));
  EXPECT_NE(refusal("/dev/zero").find("device"), std::string::npos);
}

/// 1 TB of holes after a valid beginning, which is not read or stored.
TEST_F(Foreign, FileWithAHoleOfATerabyteIsRefusedOrEndsThere) {
  constexpr off_t kTerabyte = 1'000'000'000'000;
  const std::string path =
      put(header() + record(4, u16(1) + u16(0) + text("a") + text("json") + texts({})));
  ASSERT_EQ(::truncate(path.c_str(), kTerabyte), 0);
  EXPECT_EQ(refusal(path), "");
  EXPECT_TRUE(read_outline(path));
  const auto recovery = recover(path, folder_.fresh("recovered"));
  ASSERT_TRUE(recovery);
  EXPECT_GT(recovery->cut_byte_count, 999'999'000'000u);

  // A record, a chunk and a summary whose size covers the whole hole.
  for (const char opcode : {'\x03', '\x05', '\x06', '\x09', '\x0c'}) {
    const std::string of_one = put(header() + opcode + u64(kTerabyte / 2));
    ASSERT_EQ(::truncate(of_one.c_str(), kTerabyte), 0);
    auto reader = FileReader::open(of_one, Incomplete::kRead);
    if (reader) {
      EXPECT_FALSE((*reader)->read_metadata() && (*reader)->read_attachments());
    }
    EXPECT_TRUE(check(of_one));
  }
  const std::string of_summary = put(header());
  ASSERT_EQ(::truncate(of_summary.c_str(), kTerabyte), 0);
  std::ofstream(of_summary, std::ios::binary | std::ios::app)
      << '\x02' + u64(20) + u64(100) + u64(0) + u32(0) + foreign::kMagic;
  EXPECT_NE(refusal(of_summary).find("256 MiB"), std::string::npos) << refusal(of_summary);
  EXPECT_TRUE(read_outline(of_summary));
}

std::string zstd(const std::string& records) {
  std::string compressed(ZSTD_compressBound(records.size()), '\0');
  compressed.resize(
      ZSTD_compress(compressed.data(), compressed.size(), records.data(), records.size(), 1));
  return compressed;
}

TEST_F(Foreign, ChunkIsUnpackedOnlyAsFarAsItStates) {
  const std::string message_of_a_mebibyte = message(1, 0, 5, std::string(1 << 20, 'x'));
  const std::string packed = zstd(message_of_a_mebibyte);
  const std::string begin = header() + channel(1, 0, "a");
  EXPECT_EQ(refusal(put(begin + chunk(5, 5, "zstd", packed, message_of_a_mebibyte.size()))), "");
  EXPECT_NE(refusal(put(begin + chunk(5, 5, "zstd", packed, 100))).find("decompressed"),
            std::string::npos);
  // The reader allocates no memory for more than the bytes can hold.
  EXPECT_NE(refusal(put(begin + chunk(5, 5, "zstd", packed, (1 << 28)))).find("decompressed"),
            std::string::npos);
  EXPECT_NE(refusal(put(begin + chunk(5, 5, "zstd", packed, (1 << 28) + 1))).find("256 MiB"),
            std::string::npos);
}

/// Each chunk is small on disk and large in memory: much work, but it stops on request.
TEST_F(Foreign, FileIsClosedWhenTheProgressCallbackStopsIt) {
  const std::string big = message(1, 0, 5, std::string(1 << 22, 'x'));
  std::string content = header() + channel(1, 0, "a");
  for (int i = 0; i < 50; ++i)
    content += chunk(5, 5, "zstd", zstd(big), big.size());
  const std::string path = put(content);
  int count = 0;
  const Progress stops = [&](std::uint64_t, std::uint64_t) { return ++count < 5; };
  const auto opened = FileReader::open(path, Incomplete::kRead, stops);
  ASSERT_FALSE(opened);
  EXPECT_NE(opened.error().text().find("it was stopped"), std::string::npos);
  EXPECT_EQ(count, 5);
  count = 0;
  EXPECT_FALSE(check(path, stops));
  EXPECT_EQ(count, 5);
  count = 0;
  EXPECT_FALSE(recover(path, folder_.fresh("recovered"), stops));
  EXPECT_EQ(count, 5);
  auto reader = FileReader::open(path, Incomplete::kRead);
  ASSERT_TRUE(reader);
  count = 0;
  EXPECT_FALSE((*reader)->read(
      {}, [](const Message&) { return true; }, stops));
  EXPECT_EQ(count, 5);
}

TEST_F(Foreign, ChunksThatOverlapInTimeAreHeldUpToALimit) {
  const std::string big = message(1, 0, 5, std::string(1 << 26, 'x'));
  const std::string packed = chunk(5, 5, "zstd", zstd(big), big.size());
  std::string content = header() + channel(1, 0, "a");
  for (int i = 0; i < 9; ++i)
    content += packed;
  EXPECT_NE(refusal(put(content)).find("overlap in time"), std::string::npos);
}

TEST_F(Foreign, IndexWithADuplicateOffsetIsRefused) {
  const std::string data = chunk(5, 5, channel(1, 0, "a") + message(1, 0, 5, "x"));
  const std::string index = chunk_index(5, 5, header().size(), data.size(), {{1, 0}});
  const std::string stated =
      statistics({.messages = 1, .channels = 1, .chunks = 1}, 5, 5, {{1, 1}});
  EXPECT_EQ(refusal(put(file(data, stated + index))), "");
  EXPECT_NE(refusal(put(file(data, stated + index + index))).find("contradicts itself"),
            std::string::npos);
  // The reader treats metadata and attachments in the same way.
  const std::string metadata = record(12, text("a") + texts({}));
  const std::string metadata_index =
      record(13, u64(header().size()) + u64(metadata.size()) + text("a"));
  EXPECT_EQ(refusal(put(file(metadata, statistics({.metadata = 1}, 0, 0, {}) + metadata_index))),
            "");
  EXPECT_NE(refusal(put(file(metadata, metadata_index + metadata_index))), "");
  // The reader skips an entry that points to another kind of record: @mcap/core writes such ones.
  EXPECT_EQ(refusal(put(file(data, metadata_index))), "");
}

TEST_F(Foreign, StatedTimesAreNotTrusted) {
  const std::string early = chunk(1, 9, channel(1, 0, "a") + message(1, 0, 5, "x"));
  const std::string late = chunk(10, 20, message(1, 1, 3, "y") + message(1, 2, 30, "z"));
  const std::string summary =
      channel(1, 0, "a") +
      statistics({.messages = 3, .channels = 1, .chunks = 2}, 3, 30, {{1, 3}}) +
      chunk_index(1, 9, header().size(), early.size(), {{1, 0}}) +
      chunk_index(10, 20, header().size() + early.size(), late.size(), {{1, 0}});
  const std::string path = put(file(early + late, summary));
  EXPECT_NE(refusal(path).find("outside of the times"), std::string::npos);
  const auto problems = check(path);
  ASSERT_TRUE(problems);
  ASSERT_EQ(problems->size(), 1u);
  EXPECT_NE(problems->front().find("outside of the times"), std::string::npos);
  ASSERT_TRUE(recover(path, folder_.fresh("recovered")));
  auto reader = FileReader::open(folder_.path("recovered"));
  ASSERT_TRUE(reader);
  const auto messages = read_all(**reader);
  ASSERT_EQ(messages.size(), 3u);
  EXPECT_EQ(messages[0].text, "y");

  const std::string backwards =
      put(file(early, statistics({.messages = 1, .channels = 1, .chunks = 1}, 9, 1, {{1, 1}}) +
                          chunk_index(1, 9, header().size(), early.size(), {{1, 0}})));
  EXPECT_NE(refusal(backwards).find("contradicts itself"), std::string::npos);
}

TEST_F(Foreign, TimesThatTheWriterLeftOutAreFound) {
  const std::string one = chunk(0, 0, channel(1, 0, "a") + message(1, 0, 50, "x"));
  const std::string two = chunk(0, 0, message(1, 1, 40, "y"));
  const std::string summary =
      statistics({.messages = 2, .channels = 1, .chunks = 2}, 40, 50, {{1, 2}}) +
      chunk_index(0, 0, header().size(), one.size()) +
      chunk_index(0, 0, header().size() + one.size(), two.size());
  auto reader = FileReader::open(put(file(one + two, summary)));
  ASSERT_TRUE(reader);
  const auto messages = read_all(**reader, {.from_ns = 40, .to_ns = 50});
  ASSERT_EQ(messages.size(), 2u);
  EXPECT_EQ(messages[0].text, "y");
}

TEST_F(Foreign, StampsNearTheEndOfTimeAreRead) {
  constexpr std::uint64_t kLast = UINT64_MAX;
  auto reader = FileReader::open(
      put(header() + channel(1, 0, "a") + message(1, 0, kLast, "x") + message(1, 1, 0, "y")),
      Incomplete::kRead);
  ASSERT_TRUE(reader);
  const auto messages = read_all(**reader);
  ASSERT_EQ(messages.size(), 2u);
  EXPECT_EQ(messages[1].log_time_ns, kLast);
  EXPECT_EQ((*reader)->statistics().end_ns, kLast);
}

TEST_F(Foreign, FileOfTwentyThousandChannelsIsCopiedInOrder) {
  std::string content = header();
  for (std::uint64_t i = 1; i <= 20'000; ++i)
    content += channel(i, 0, "topic/" + std::to_string(i));
  content += message(20'000, 0, 5, "x");
  const auto recovery = recover(put(content), folder_.fresh("recovered"));
  ASSERT_TRUE(recovery);
  auto reader = FileReader::open(folder_.path("recovered"));
  ASSERT_TRUE(reader);
  EXPECT_EQ((*reader)->channels().size(), 20'000u);
  EXPECT_EQ(read_all(**reader).size(), 1u);
}

}  // namespace
}  // namespace rtpm::recording
