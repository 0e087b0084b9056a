#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <vector>

#include "rtpm/recording/file_reader.hpp"
#include "rtpm/recording/file_writer.hpp"

namespace rtpm::recording {

inline ConstBytes bytes_of(std::string_view text) {
  return std::as_bytes(std::span(text));
}
inline std::string text_of(ConstBytes bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

/// The running test's own folder, removed with it. It is in memory where possible, because closing
/// a recording waits for the disk.
class Folder {
 public:
  Folder() {
    const bool has_memory = std::filesystem::is_directory("/dev/shm");
    const std::string begin = (has_memory ? "/dev/shm/" : testing::TempDir()) + "rtpm_recording_";
    do {
      path_ = begin + std::to_string(std::random_device{}());
    } while (!std::filesystem::create_directory(path_));
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  ~Folder() { std::filesystem::remove_all(path_); }
  /// A path in the folder.
  [[nodiscard]] std::string path(const std::string& name) const {
    return path_ + "/" + name + ".mcap";
  }
  /// A path in the folder at which there is no file.
  [[nodiscard]] std::string fresh(const std::string& name) const {
    std::string free = path(name);
    std::filesystem::remove_all(free);
    return free;
  }

 private:
  std::string path_;
};

inline std::string content_of(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}
inline void put_content(const std::string& path, std::string_view content) {
  std::ofstream(path, std::ios::binary) << content;
}

/// A message as read, with a copy of its bytes.
struct Read {
  std::uint16_t channel_id;
  std::uint32_t sequence;
  std::uint64_t log_time_ns;
  std::string text;
  friend bool operator==(const Read&, const Read&) = default;
};

/// All messages; the test fails if they can't be read.
inline std::vector<Read> read_all(FileReader& reader, const Query& query = {}) {
  std::vector<Read> messages;
  const auto read = reader.read(query, [&](const Message& message) {
    messages.push_back(
        {message.channel_id, message.sequence, message.log_time_ns, text_of(message.data)});
    return true;
  });
  EXPECT_TRUE(read) << read.error().text();
  return messages;
}

/// Two channels, one with a schema; `count` messages, 1 ms apart, alternate between them.
inline void write_messages(FileWriter& writer, int count) {
  const auto schema = writer.add_schema(
      {.name = "lab.Touched", .encoding = "flatbuffer", .data = std::vector(300, std::byte{7})});
  ASSERT_TRUE(schema);
  const auto touched = writer.add_channel({.schema_id = *schema,
                                           .topic = "lab/touched",
                                           .message_encoding = "flatbuffer",
                                           .metadata = {{"rtpm.priority", "24000"}}});
  const auto log = writer.add_channel({.topic = "log", .message_encoding = "json"});
  ASSERT_TRUE(touched && log);
  for (int i = 0; i < count; ++i) {
    const std::string text = "message " + std::to_string(i);
    const auto time_ns = std::uint64_t{1'000'000} * static_cast<std::uint64_t>(i + 1);
    const auto written = writer.write({.channel_id = i % 2 == 0 ? *touched : *log,
                                       .sequence = static_cast<std::uint32_t>(i),
                                       .log_time_ns = time_ns,
                                       .publish_time_ns = time_ns,
                                       .data = bytes_of(text)});
    ASSERT_TRUE(written) << written.error().text();
  }
}

}  // namespace rtpm::recording
