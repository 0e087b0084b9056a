#include <algorithm>
#include <map>
#include <utility>

#include "input_file.hpp"
#include "rtpm/recording/file_reader.hpp"
#include "rtpm/recording/file_writer.hpp"
#include "rtpm/recording/notes.hpp"
#include "rtpm/recording/repair.hpp"

namespace rtpm::recording {
namespace {

/// Copies the messages that a query selects, and their channels.
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
  /// The channel's number in the new file.
  expected<std::uint16_t, SetupError> number_of(std::uint16_t channel_id) {
    if (const auto known = numbers_.find(channel_id); known != numbers_.end()) return known->second;
    const auto found = reader_.channels().find(channel_id);
    if (found == reader_.channels().end())
      return setup_error("a message has a channel that is not there", "", kRepair);
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

}  // namespace

expected<std::uint64_t, SetupError> cut(const std::string& from, const std::string& to,
                                        const Query& query, std::span<const Message> first,
                                        const Progress& progress) {
  auto reader = FileReader::open(from, Incomplete::kRefuse, progress);
  if (!reader) return unexpected{reader.error()};
  auto notes = read_notes(from);
  if (!notes) return unexpected{notes.error()};
  auto made = NewRecording::create(to);
  if (!made) return unexpected{made.error()};
  Selection selection(**reader, made->writer());
  for (const Message& message : first) {
    if (auto taken = selection.take(message); !taken) return unexpected{taken.error()};
  }
  const std::uint64_t stated = (*reader)->statistics().message_count;
  expected<void, SetupError> copied{};
  std::uint64_t count = 0;
  const auto read = (*reader)->read(
      query,
      [&](const Message& message) {
        copied = selection.take(message);
        const bool is_reported = progress && ++count % kProgressStep == 0;
        if (copied && is_reported && !progress(std::min(count, stated), stated)) {
          copied = unexpected{stopped(to)};
        }
        return copied.has_value();
      },
      progress);
  if (!read) return unexpected{read.error()};
  if (!copied) return unexpected{copied.error()};
  if (auto more = copy_extras(**reader, made->writer()); !more) return unexpected{more.error()};
  auto finished = made->finish();
  std::erase_if(*notes, [&query](const Note& note) {
    return note.time_ns < query.from_ns || note.time_ns > query.to_ns;
  });
  if (!finished || notes->empty()) return finished;
  if (auto written = write_notes(to, std::move(*notes)); !written) {
    return unexpected{written.error()};
  }
  return finished;
}

}  // namespace rtpm::recording
