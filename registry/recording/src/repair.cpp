#include "rtpm/recording/repair.hpp"

#include <algorithm>
#include <map>
#include <optional>

#include "input_file.hpp"
#include "rtpm/recording/file_reader.hpp"
#include "rtpm/recording/file_writer.hpp"

namespace rtpm::recording {
namespace {

/// Copies records into a new recording, where schemas and channels have other numbers.
class Copy {
 public:
  explicit Copy(FileWriter& writer) noexcept : writer_(writer) {}

  expected<void, SetupError> take(Opcode opcode, ConstBytes content) {
    if (opcode == Opcode::kSchema) return take_schema(content);
    if (opcode == Opcode::kChannel) return take_channel(content);
    if (opcode == Opcode::kMessage) return take_message(content);
    if (opcode == Opcode::kMetadata) {
      if (const auto metadata = parse_metadata(content)) return writer_.write(*metadata);
    } else if (opcode == Opcode::kAttachment) {
      if (const auto attachment = parse_attachment(content)) return writer_.write(*attachment);
    }
    return {};
  }

 private:
  expected<void, SetupError> take_schema(ConstBytes content) {
    const auto schema = parse_schema(content);
    if (!schema) return {};
    const auto number = writer_.add_schema(schema->second);
    if (!number) return unexpected{number.error()};
    schemas_[schema->first] = *number;
    return {};
  }
  expected<void, SetupError> take_channel(ConstBytes content) {
    auto channel = parse_channel(content);
    if (!channel) return {};
    // A channel whose schema was in a damaged chunk goes on without it.
    const auto schema = schemas_.find(channel->second.schema_id);
    channel->second.schema_id = schema == schemas_.end() ? std::uint16_t{0} : schema->second;
    const auto number = writer_.add_channel(channel->second);
    if (!number) return unexpected{number.error()};
    channels_[channel->first] = *number;
    return {};
  }
  expected<void, SetupError> take_message(ConstBytes content) {
    auto message = parse_message(content);
    const auto channel = message ? channels_.find(message->channel_id) : channels_.end();
    if (channel == channels_.end()) return {};
    message->channel_id = channel->second;
    return writer_.write(*message);
  }

  FileWriter& writer_;
  std::map<std::uint16_t, std::uint16_t> schemas_{};
  std::map<std::uint16_t, std::uint16_t> channels_{};
};

expected<void, SetupError> copy_chunk(const InputFile& file, const RecordPlace& chunk, Copy& copy,
                                      Recovery& recovery) {
  const auto records = unpack(file, chunk);
  if (!records) {
    ++recovery.damaged_chunk_count;
    return {};
  }
  expected<void, SetupError> copied{};
  static_cast<void>(
      for_each_record(*records, [&](Opcode opcode, ConstBytes content, std::uint64_t) {
        copied = copy.take(opcode, content);
        return copied.has_value();
      }));
  return copied;
}

/// Where DataEnd is; nothing: the data section has no end.
std::optional<RecordPlace> find_data_end(const InputFile& file) {
  std::optional<RecordPlace> found;
  static_cast<void>(for_each_record(file, [&](const RecordPlace& record) {
    if (record.opcode == Opcode::kDataEnd) found = record;
    return true;
  }));
  return found;
}

/// @return what is wrong; empty: nothing
std::string check_data_crc(const InputFile& file) {
  const auto data_end = find_data_end(file);
  if (!data_end) return "it has no end of its data";
  const auto content = file.content(*data_end);
  const auto stated = content ? parse_data_end(*content) : std::optional<std::uint32_t>{};
  if (!stated) return "the end of its data is unreadable";
  if (*stated == 0) return {};
  std::uint32_t crc = 0;
  constexpr std::uint64_t kStep = 1 << 20;
  for (std::uint64_t offset = 0; offset < data_end->offset; offset += kStep) {
    const auto bytes = file.read(offset, std::min(kStep, data_end->offset - offset));
    if (!bytes) return bytes.error().reason();
    crc = crc32(*bytes, crc);
  }
  return crc == *stated ? "" : "the checksum of its data is wrong";
}

}  // namespace

expected<Recovery, SetupError> recover(const std::string& from, const std::string& to) {
  const auto file = InputFile::open(from);
  if (!file) return unexpected{file.error()};
  auto writer = FileWriter::create(to);
  if (!writer) return unexpected{writer.error()};
  Copy copy(**writer);
  Recovery recovery;
  expected<void, SetupError> copied{};
  bool is_ended = false;
  const std::uint64_t end = for_each_record(*file, [&](const RecordPlace& record) {
    if (record.opcode == Opcode::kChunk) {
      copied = copy_chunk(*file, record, copy, recovery);
    } else if (const auto content = file->content(record)) {
      copied = copy.take(record.opcode, *content);
    }
    is_ended = record.opcode == Opcode::kDataEnd;
    return copied.has_value();
  });
  if (!copied) return unexpected{copied.error()};
  if (!is_ended) recovery.cut_byte_count = file->size() - end;
  if (auto closed = (*writer)->close(); !closed) return unexpected{closed.error()};
  recovery.message_count = (*writer)->statistics().message_count;
  return recovery;
}

expected<std::vector<std::string>, SetupError> check(const std::string& path) {
  auto file = InputFile::open(path);
  if (!file) return unexpected{file.error()};
  std::vector<std::string> problems;
  auto reader = FileReader::open(path, Incomplete::kRead);
  if (!reader) return std::vector<std::string>{reader.error().reason()};
  if (!(*reader)->is_complete()) {
    problems.emplace_back("it was not ended");
  } else if (std::string problem = check_data_crc(*file); !problem.empty()) {
    problems.push_back(std::move(problem));
  }
  std::uint64_t count = 0;
  std::uint64_t unknown_count = 0;
  const auto read = (*reader)->read({}, [&](const Message& message) {
    ++count;
    if (!(*reader)->channels().contains(message.channel_id)) ++unknown_count;
    return true;
  });
  if (!read) {
    problems.push_back(read.error().reason());
  } else if (const std::uint64_t stated = (*reader)->statistics().message_count; count != stated) {
    problems.push_back("it has " + std::to_string(count) + " messages, and states " +
                       std::to_string(stated));
  }
  if (unknown_count > 0) {
    problems.push_back(std::to_string(unknown_count) +
                       " messages have a channel that is not there");
  }
  return problems;
}

}  // namespace rtpm::recording
