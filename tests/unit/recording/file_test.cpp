#include "recorded.hpp"

namespace rtpm::recording {
namespace {

class Recording : public testing::Test {
 protected:
  Folder folder_;
};
class RoundTrip : public Recording, public testing::WithParamInterface<Compression> {};
INSTANTIATE_TEST_SUITE_P(Each, RoundTrip,
                         testing::Values(Compression::kNone, Compression::kLz4,
                                         Compression::kZstd));

TEST_P(RoundTrip, GivesBackAllThatWasWritten) {
  const std::string path = folder_.fresh("file");
  const Attachment attachment{.name = "lab.conf",
                              .media_type = "text/plain",
                              .log_time_ns = 5,
                              .data = std::vector(10, std::byte{'x'})};
  const Metadata metadata{.name = "host", .values = {{"kernel", "rt"}, {"cores", "2"}}};
  {
    auto writer = FileWriter::create(path, {.compression = GetParam(), .chunk_byte_max = 2000});
    ASSERT_TRUE(writer) << writer.error().text();
    write_messages(**writer, 500);
    ASSERT_TRUE((*writer)->write(attachment));
    ASSERT_TRUE((*writer)->write(metadata));
    ASSERT_TRUE((*writer)->close());
  }
  auto reader = FileReader::open(path);
  ASSERT_TRUE(reader) << reader.error().text();
  EXPECT_TRUE((*reader)->is_complete());
  ASSERT_EQ((*reader)->channels().size(), 2u);
  EXPECT_EQ((*reader)->channels().at(1).metadata.at("rtpm.priority"), "24000");
  EXPECT_EQ((*reader)->schemas().at(1).data, std::vector(300, std::byte{7}));
  const Statistics& statistics = (*reader)->statistics();
  EXPECT_EQ(statistics.message_count, 500u);
  EXPECT_GT(statistics.chunk_count, 5u);
  EXPECT_EQ(statistics.begin_ns, 1'000'000u);
  EXPECT_EQ(statistics.end_ns, 500'000'000u);
  EXPECT_EQ(statistics.message_counts,
            (std::map<std::uint16_t, std::uint64_t>{{1, 250}, {2, 250}}));
  const auto messages = read_all(**reader);
  ASSERT_EQ(messages.size(), 500u);
  EXPECT_EQ(messages[7], (Read{2, 7, 8'000'000, "message 7"}));
  const auto read_metadata = (*reader)->read_metadata();
  ASSERT_TRUE(read_metadata);
  EXPECT_EQ(*read_metadata, std::vector{metadata});
  const auto read_attachments = (*reader)->read_attachments();
  ASSERT_TRUE(read_attachments);
  EXPECT_EQ(*read_attachments, std::vector{attachment});
}

TEST_F(Recording, IsReadByTimeAndChannel) {
  const std::string path = folder_.fresh("file");
  {
    auto writer = FileWriter::create(path, {.chunk_byte_max = 1000});
    ASSERT_TRUE(writer);
    write_messages(**writer, 100);
  }
  auto reader = FileReader::open(path);
  ASSERT_TRUE(reader) << "the destructor closes: " << reader.error().text();
  const auto some = read_all(**reader, {.from_ns = 20'000'000, .to_ns = 29'000'000});
  ASSERT_EQ(some.size(), 10u);
  EXPECT_EQ(some.front().sequence, 19u);
  EXPECT_EQ(read_all(**reader, {.channel_ids = {2}}).size(), 50u);
  int visited = 0;
  ASSERT_TRUE((*reader)->read({}, [&](const Message&) { return ++visited < 3; }));
  EXPECT_EQ(visited, 3) << "until the visitor has enough";
}

/// Sources are not in step: a later chunk may contain messages that were sent earlier.
TEST_F(Recording, IsReadInTheOrderOfTimeAcrossChunks) {
  const std::string path = folder_.fresh("file");
  {
    auto writer = FileWriter::create(path, {.chunk_byte_max = 1});
    ASSERT_TRUE(writer);
    const auto channel = (*writer)->add_channel({.topic = "a", .message_encoding = "json"});
    std::uint32_t sequence = 0;
    for (const std::uint64_t time_ns : {5u, 3u, 9u, 3u, 1u, 7u}) {
      ASSERT_TRUE((*writer)->write(
          {.channel_id = *channel, .sequence = sequence++, .log_time_ns = time_ns}));
    }
  }
  auto reader = FileReader::open(path);
  ASSERT_TRUE(reader);
  std::vector<std::uint32_t> order;
  for (const Read& message : read_all(**reader))
    order.push_back(message.sequence);
  EXPECT_EQ(order, (std::vector<std::uint32_t>{4, 1, 3, 0, 5, 2}));
}

TEST_F(Recording, MayHaveNoMessages) {
  const std::string path = folder_.fresh("file");
  ASSERT_TRUE((*FileWriter::create(path))->close());
  auto reader = FileReader::open(path);
  ASSERT_TRUE(reader) << reader.error().text();
  EXPECT_TRUE(read_all(**reader).empty());
}

TEST_F(Recording, RefusesUnknownChannelsAndSchemas) {
  auto writer = FileWriter::create(folder_.fresh("file"));
  ASSERT_TRUE(writer);
  EXPECT_FALSE((*writer)->write(Message{.channel_id = 1}));
  EXPECT_FALSE((*writer)->add_channel({.schema_id = 1, .topic = "a", .message_encoding = "json"}));
  const auto channel = (*writer)->add_channel({.topic = "a", .message_encoding = "json"});
  EXPECT_EQ(*(*writer)->add_channel({.topic = "a", .message_encoding = "json"}), *channel);
  EXPECT_FALSE((*writer)->write(Message{.channel_id = 0}));
}

TEST_F(Recording, IsNeverOverwritten) {
  const std::string path = folder_.fresh("file");
  put_content(path, "precious");
  const auto writer = FileWriter::create(path);
  ASSERT_FALSE(writer);
  EXPECT_NE(writer.error().text().find("name another file"), std::string::npos);
  EXPECT_EQ(content_of(path), "precious");
  EXPECT_FALSE(FileWriter::create("/no such folder/a.mcap"));
}

TEST_F(Recording, RefusesOtherFiles) {
  const std::string path = folder_.fresh("file");
  EXPECT_FALSE(FileReader::open(path));
  for (const std::string_view content : {"", "short", "no recording, but long enough for one"}) {
    put_content(path, content);
    const auto reader = FileReader::open(path);
    ASSERT_FALSE(reader);
    EXPECT_NE(reader.error().text().find("is no recording"), std::string::npos);
  }
  EXPECT_FALSE(FileReader::open(testing::TempDir())) << "a folder";
}

}  // namespace
}  // namespace rtpm::recording
