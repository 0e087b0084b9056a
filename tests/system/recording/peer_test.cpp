#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "rtpm/recording/file_reader.hpp"
#include "rtpm/recording/file_writer.hpp"
#include "rtpm/recording/repair.hpp"
#include "rtpm/test/npm_peer.hpp"

/// Recordings beside another implementation of MCAP, @mcap/core from npm.
namespace rtpm::recording {
namespace {

using nlohmann::json;

class McapPeer : public testing::Test {
 protected:
  void SetUp() override {
    if (!test::install_peer()) GTEST_SKIP() << "npm is not installed, or can't install @mcap/core";
    const auto* const test = testing::UnitTest::GetInstance()->current_test_info();
    file_ = testing::TempDir() + "rtpm_peer_" + test->name() + ".mcap";
    std::filesystem::remove(file_);
  }
  void TearDown() override { std::filesystem::remove(file_); }
  void write_own(Compression compression);

  std::string file_;
};

void McapPeer::write_own(Compression compression) {
  auto writer = FileWriter::create(file_, {.compression = compression, .chunk_byte_max = 1000});
  ASSERT_TRUE(writer) << writer.error().text();
  const auto schema = (*writer)->add_schema(
      {.name = "lab.Touched", .encoding = "jsonschema", .data = std::vector(2, std::byte{'{'})});
  const auto channel = (*writer)->add_channel({.schema_id = *schema,
                                               .topic = "lab/touched",
                                               .message_encoding = "json",
                                               .metadata = {{"rtpm.priority", "24000"}}});
  for (std::uint32_t i = 0; i < 100; ++i) {
    const std::string text = "{\"force\":" + std::to_string(i) + "}";
    ASSERT_TRUE((*writer)->write({.channel_id = *channel,
                                  .sequence = i,
                                  .log_time_ns = 1000 * (i + 1),
                                  .publish_time_ns = 1000 * i,
                                  .data = std::as_bytes(std::span(text))}));
  }
  ASSERT_TRUE((*writer)->write(Metadata{.name = "host", .values = {{"cores", "2"}}}));
  ASSERT_TRUE((*writer)->write(Attachment{.name = "lab.conf",
                                          .media_type = "text/plain",
                                          .log_time_ns = 7,
                                          .data = std::vector(3, std::byte{'x'})}));
  ASSERT_TRUE((*writer)->close());
}

TEST_F(McapPeer, ReadsOurRecordings) {
  for (const Compression compression :
       {Compression::kNone, Compression::kLz4, Compression::kZstd}) {
    std::filesystem::remove(file_);
    write_own(compression);
    const json read = test::run_peer("read.mjs '" + file_ + "'");
    EXPECT_EQ(read["library"], "rtpm");
    EXPECT_EQ(read["schemas"][0]["name"], "lab.Touched");
    EXPECT_EQ(read["channels"][0]["metadata"]["rtpm.priority"], "24000");
    EXPECT_EQ(read["statistics"]["messageCount"], 100);
    EXPECT_EQ(read["statistics"]["chunkCount"], read["chunks"]);
    EXPECT_GT(read["chunks"], 3);
    ASSERT_EQ(read["messages"].size(), 100u);
    EXPECT_EQ(read["messages"][42]["sequence"], 42);
    EXPECT_EQ(read["messages"][42]["logTime"], 43'000);
    EXPECT_EQ(read["messages"][42]["data"], "{\"force\":42}");
    EXPECT_EQ(read["metadata"][0]["metadata"]["cores"], "2");
    EXPECT_EQ(read["attachments"][0]["data"], "xxx");
    // The peer streams the file from end to end, and checks each checksum.
    EXPECT_EQ(read["streamed_count"], 100);
    EXPECT_EQ(read["is_done"], true);
  }
}

TEST_F(McapPeer, IsReadByUs) {
  for (const std::string form : {"none", "zstd", "loose"}) {
    std::filesystem::remove(file_);
    static_cast<void>(test::run_peer("write.mjs '" + file_ + "' " + form));
    auto reader = FileReader::open(file_);
    ASSERT_TRUE(reader) << form << reader.error().text();
    EXPECT_EQ((*reader)->statistics().message_count, 100u) << form;
    EXPECT_EQ((*reader)->schemas().begin()->second.name, "lab.Touched");
    std::uint32_t count = 0;
    const auto read = (*reader)->read({}, [&](const Message& message) {
      EXPECT_EQ(message.sequence, count);
      const Channel& channel = (*reader)->channels().at(message.channel_id);
      EXPECT_EQ(channel.topic, count % 2 == 0 ? "a" : "b");
      EXPECT_EQ(channel.metadata.at("unit"), "newton");
      ++count;
      return true;
    });
    EXPECT_TRUE(read) << form << read.error().text();
    EXPECT_EQ(count, 100u) << form;
    EXPECT_EQ((*reader)->read_metadata()->size(), 1u) << form;
    EXPECT_EQ((*reader)->read_attachments()->size(), 1u) << form;
    EXPECT_EQ(*check(file_), std::vector<std::string>{}) << form;
  }
}

}  // namespace
}  // namespace rtpm::recording
