#include "rtpm/recording/repair.hpp"

#include <algorithm>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <utility>

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

SetupError stopped(const std::string& path) {
  return {path + " is not done", "it was stopped"};
}

/// A new recording under another name until it is whole.
class NewRecording {
 public:
  [[nodiscard]] static expected<NewRecording, SetupError> create(const std::string& path) {
    if (std::filesystem::exists(path)) {
      return setup_error("'" + path + "' can't be written", "it exists already",
                         "choose another name, or remove it");
    }
    NewRecording made(path);
    std::error_code ignored;
    std::filesystem::remove(made.draft(), ignored);  // Of a program that died.
    auto writer = FileWriter::create(made.draft());
    if (!writer) return unexpected{writer.error()};
    made.writer_ = std::move(*writer);
    return made;
  }
  NewRecording(NewRecording&&) noexcept = default;
  NewRecording& operator=(NewRecording&&) = delete;
  ~NewRecording() {
    std::error_code ignored;
    if (writer_) std::filesystem::remove(draft(), ignored);
  }

  [[nodiscard]] FileWriter& writer() noexcept { return *writer_; }

  /// Gives it its name. @return how many messages it has
  [[nodiscard]] expected<std::uint64_t, SetupError> finish() {
    if (auto closed = writer_->close(); !closed) return unexpected{closed.error()};
    const std::uint64_t count = writer_->statistics().message_count;
    std::error_code cause;
    std::filesystem::rename(draft(), path_, cause);
    if (cause) return setup_error("'" + path_ + "' can't be written", cause);
    writer_.reset();
    return count;
  }

 private:
  explicit NewRecording(std::string path) noexcept : path_(std::move(path)) {}
  [[nodiscard]] std::string draft() const { return path_ + ".part"; }

  std::string path_;
  std::unique_ptr<FileWriter> writer_{};
};

/// Copies the messages of a query, and the channels that have some.
class Selection {
 public:
  Selection(FileReader& reader, FileWriter& writer) noexcept : reader_(reader), writer_(writer) {}

  expected<void, SetupError> take(Message message) {
    const auto number = number_of(message.channel_id);
    if (!number) return unexpected{number.error()};
    message.channel_id = *number;
    return writer_.write(message);
  }

 private:
  /// In the new file.
  expected<std::uint16_t, SetupError> number_of(std::uint16_t channel_id) {
    if (const auto known = numbers_.find(channel_id); known != numbers_.end()) return known->second;
    const auto found = reader_.channels().find(channel_id);
    if (found == reader_.channels().end()) return setup_error("a message has no channel");
    Channel channel = found->second;
    if (const auto schema = reader_.schemas().find(channel.schema_id);
        schema != reader_.schemas().end()) {
      const auto schema_number = writer_.add_schema(schema->second);
      if (!schema_number) return unexpected{schema_number.error()};
      channel.schema_id = *schema_number;
    } else {
      channel.schema_id = 0;
    }
    const auto number = writer_.add_channel(channel);
    if (number) numbers_[channel_id] = *number;
    return number;
  }

  FileReader& reader_;
  FileWriter& writer_;
  std::map<std::uint16_t, std::uint16_t> numbers_{};
};

expected<void, SetupError> copy_extras(FileReader& reader, FileWriter& writer) {
  const auto metadata = reader.read_metadata();
  if (!metadata) return unexpected{metadata.error()};
  for (const Metadata& one : *metadata) {
    if (auto written = writer.write(one); !written) return written;
  }
  const auto attachments = reader.read_attachments();
  if (!attachments) return unexpected{attachments.error()};
  for (const Attachment& one : *attachments) {
    if (auto written = writer.write(one); !written) return written;
  }
  return {};
}

/// How many messages go by between two reports of progress.
constexpr std::uint64_t kProgressStep = 4096;

bool goes_on(const Progress& progress, std::uint64_t done, std::uint64_t whole) {
  return !progress || progress(done, whole);
}

}  // namespace

expected<Recovery, SetupError> recover(const std::string& from, const std::string& to,
                                       const Progress& progress) {
  const auto file = InputFile::open(from);
  if (!file) return unexpected{file.error()};
  auto made = NewRecording::create(to);
  if (!made) return unexpected{made.error()};
  Copy copy(made->writer());
  Recovery recovery;
  expected<void, SetupError> copied{};
  bool is_ended = false;
  const std::uint64_t end = for_each_record(*file, [&](const RecordPlace& record) {
    if (record.opcode == Opcode::kChunk) {
      copied = copy_chunk(*file, record, copy, recovery);
    } else if (const auto content = file->content(record)) {
      copied = copy.take(record.opcode, *content);
    }
    if (copied && !goes_on(progress, record.offset, file->size())) {
      copied = unexpected{stopped(to)};
    }
    is_ended = record.opcode == Opcode::kDataEnd;
    return copied.has_value();
  });
  if (!copied) return unexpected{copied.error()};
  if (!is_ended) recovery.cut_byte_count = file->size() - end;
  const auto count = made->finish();
  if (!count) return unexpected{count.error()};
  recovery.message_count = *count;
  return recovery;
}

expected<std::uint64_t, SetupError> cut(const std::string& from, const std::string& to,
                                        const Query& query, const Progress& progress) {
  auto reader = FileReader::open(from);
  if (!reader) return unexpected{reader.error()};
  auto made = NewRecording::create(to);
  if (!made) return unexpected{made.error()};
  Selection selection(**reader, made->writer());
  const Statistics& statistics = (*reader)->statistics();
  expected<void, SetupError> copied{};
  std::uint64_t count = 0;
  const auto read = (*reader)->read(query, [&](const Message& message) {
    copied = selection.take(message);
    if (copied && ++count % kProgressStep == 0 &&
        !goes_on(progress, message.log_time_ns - statistics.begin_ns,
                 statistics.end_ns - statistics.begin_ns)) {
      copied = unexpected{stopped(to)};
    }
    return copied.has_value();
  });
  if (!read) return unexpected{read.error()};
  if (!copied) return unexpected{copied.error()};
  if (auto more = copy_extras(**reader, made->writer()); !more) return unexpected{more.error()};
  return made->finish();
}

expected<std::vector<std::string>, SetupError> check(const std::string& path,
                                                     const Progress& progress) {
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
  const std::uint64_t stated = (*reader)->statistics().message_count;
  std::uint64_t count = 0;
  std::uint64_t unknown_count = 0;
  bool is_stopped = false;
  const auto read = (*reader)->read({}, [&](const Message& message) {
    if (!(*reader)->channels().contains(message.channel_id)) ++unknown_count;
    is_stopped = ++count % kProgressStep == 0 && !goes_on(progress, count, stated);
    return !is_stopped;
  });
  if (is_stopped) return unexpected{stopped("the check of " + path)};
  if (!read) {
    problems.push_back(read.error().reason());
  } else if (count != stated) {
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
