#include <algorithm>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "contents.hpp"
#include "rtpm/base/utf8_path.hpp"
#include "rtpm/recording/file_writer.hpp"
#include "rtpm/recording/repair.hpp"

namespace rtpm::recording {
namespace {

/// Copies records into a new recording, and renumbers schemas and channels.
class Copy {
 public:
  Copy(FileWriter& writer, Recovery& recovery) noexcept : writer_(writer), recovery_(recovery) {}

  expected<void, SetupError> take(Opcode opcode, ConstBytes content) {
    if (opcode == Opcode::kSchema) return take_schema(content);
    if (opcode == Opcode::kChannel) return take_channel(content);
    if (opcode == Opcode::kMessage) return take_message(content);
    if (opcode == Opcode::kMetadata) {
      if (const auto metadata = parse<Metadata>(content)) return writer_.write(*metadata);
      recovery_.cut_byte_count += content.size();
    } else if (opcode == Opcode::kAttachment) {
      if (const auto attachment = parse<Attachment>(content)) return writer_.write(*attachment);
      recovery_.cut_byte_count += content.size();
    }
    return {};
  }
  /// The topic, "lab/arm0/sampled"; "channel 7" if no intact record describes the channel.
  [[nodiscard]] std::string topic_of(std::uint16_t channel) const {
    const auto found = topics_.find(channel);
    return found == topics_.end() ? "channel " + std::to_string(channel) : found->second;
  }
  [[nodiscard]] std::vector<std::string> untyped_topics() const {
    return {untyped_.begin(), untyped_.end()};
  }

 private:
  expected<void, SetupError> take_schema(ConstBytes content) {
    const auto schema = parse<NumberedSchema>(content);
    if (!schema) return {};
    const auto number = writer_.add_schema(schema->second);
    if (!number) return unexpected{number.error()};
    schemas_[schema->first] = *number;
    return {};
  }
  expected<void, SetupError> take_channel(ConstBytes content) {
    auto channel = parse<NumberedChannel>(content);
    if (!channel) return {};
    // A channel whose schema was in a damaged chunk is copied without it.
    const std::uint16_t wanted = channel->second.schema_id;
    const auto schema = schemas_.find(wanted);
    const bool is_typed = wanted == 0 || schema != schemas_.end();
    channel->second.schema_id = schema == schemas_.end() ? std::uint16_t{0} : schema->second;
    const auto number = writer_.add_channel(channel->second);
    if (!number) return unexpected{number.error()};
    channels_[channel->first] = *number;
    const std::string& topic = topics_[channel->first] = channel->second.topic;
    if (is_typed) {
      untyped_.erase(topic);
    } else {
      untyped_.insert(topic);
    }
    return {};
  }
  expected<void, SetupError> take_message(ConstBytes content) {
    auto message = parse<Message>(content);
    if (!message) return {};
    const auto channel = channels_.find(message->channel_id);
    if (channel == channels_.end()) {
      ++recovery_.unknown_channel_count;
      return {};
    }
    message->channel_id = channel->second;
    return writer_.write(*message);
  }

  FileWriter& writer_;
  Recovery& recovery_;
  std::map<std::uint16_t, std::uint16_t> schemas_{};
  std::map<std::uint16_t, std::uint16_t> channels_{};
  std::map<std::uint16_t, std::string> topics_{};
  std::set<std::string> untyped_{};
};

/// Recovers one recording into another.
class Rescue {
 public:
  Rescue(const InputFile& file, FileWriter& writer, const Progress& progress)
      : file_(file), writer_(writer), progress_(progress), copy_(writer, recovery_) {}

  expected<Recovery, SetupError> run(const std::string& to) {
    if (auto learned = learn_summary(); !learned) return unexpected{learned.error()};
    std::uint64_t offset = kMagicSize;
    while (offset < data_end_) {
      if (progress_ && !progress_(offset, file_.size())) return unexpected{stopped(to)};
      const auto next = step(offset);
      if (!next) return unexpected{next.error()};
      if (*next == 0) break;
      offset = *next;
    }
    for (const auto& [channel, lost] : lost_)
      recovery_.lost_counts[copy_.topic_of(channel)] += lost;
    recovery_.untyped_topics = copy_.untyped_topics();
    if (auto said = say_what_is_lost(); !said) return unexpected{said.error()};
    return std::move(recovery_);
  }

 private:
  expected<void, SetupError> learn_summary();
  /// Handles the record at `offset`.
  /// @return   the offset at which to continue; 0 at the end
  expected<std::uint64_t, SetupError> step(std::uint64_t offset);
  /// Skips the incomplete record at `offset`. @return like step()
  std::uint64_t skip(std::uint64_t offset, std::optional<std::uint64_t> next);
  expected<void, SetupError> take_chunk(const UnpackedChunk& chunk);
  void lose_chunk(std::uint64_t end);
  expected<void, SetupError> say_what_is_lost();

  const InputFile& file_;
  FileWriter& writer_;
  const Progress& progress_;
  Recovery recovery_{};
  Copy copy_;
  std::uint64_t data_end_ = file_.size();
  std::set<std::uint64_t> places_{};  ///< Positions of records that the summary lists.
  /// The chunks' ends, keyed by their positions.
  std::map<std::uint64_t, std::uint64_t> chunk_ends_{};
  std::map<std::uint16_t, std::uint64_t> lost_{};  ///< Lost messages, keyed by channel.
};

/// Reads channels and schemas first: otherwise they may be in a damaged chunk only.
expected<void, SetupError> Rescue::learn_summary() {
  const auto place = find_summary(file_);
  if (!place || !*place || (*place)->begin == (*place)->end) return {};
  const auto summary = read_summary(file_, **place);
  if (!summary) return {};
  data_end_ = (*place)->begin;
  expected<void, SetupError> taken{};
  static_cast<void>(for_each_record(*summary, [&](Opcode opcode, ConstBytes content,
                                                  std::uint64_t) {
    const bool is_extra = opcode == Opcode::kAttachmentIndex || opcode == Opcode::kMetadataIndex;
    if (opcode == Opcode::kSchema || opcode == Opcode::kChannel) {
      taken = copy_.take(opcode, content);
    } else if (opcode == Opcode::kChunkIndex) {
      const auto index = parse<ChunkIndex>(content);
      if (index && index->chunk_offset < data_end_) {
        places_.insert(index->chunk_offset);
        chunk_ends_[index->chunk_offset] =
            index->chunk_offset + std::min(index->chunk_size, data_end_);
      }
    } else if (is_extra) {
      places_.insert(ByteReader(content).take<std::uint64_t>());
    }
    return taken.has_value() && places_.size() <= kPlaceCountMax;
  }));
  return taken;
}

expected<std::uint64_t, SetupError> Rescue::step(std::uint64_t offset) {
  const auto record = file_.record_at(offset);
  const auto known = places_.upper_bound(offset);
  const auto next = known == places_.end() ? std::nullopt : std::optional(*known);
  const bool is_chunk = chunk_ends_.contains(offset);
  const bool is_sound = record && record->end() <= next.value_or(data_end_) &&
                        (!is_chunk || record->opcode == Opcode::kChunk);
  if (!is_sound) return skip(offset, next);
  if (record->opcode == Opcode::kDataEnd) return 0;
  if (record->opcode == Opcode::kChunk) {
    const auto unpacked = unpack(file_, *record);
    if (!unpacked && is_chunk) return skip(offset, next);
    if (!unpacked) {
      lose_chunk(record->end());
    } else if (auto taken = take_chunk(*unpacked); !taken) {
      return unexpected{taken.error()};
    }
  } else if (const auto content = file_.content(*record)) {
    if (auto taken = copy_.take(record->opcode, *content); !taken) return unexpected{taken.error()};
  } else {
    recovery_.cut_byte_count += record->content_size;
  }
  return record->end();
}

std::uint64_t Rescue::skip(std::uint64_t offset, std::optional<std::uint64_t> next) {
  if (const auto chunk = chunk_ends_.find(offset); chunk != chunk_ends_.end()) {
    lose_chunk(chunk->second);
    if (chunk->second > offset && chunk->second <= next.value_or(data_end_)) return chunk->second;
  } else {
    recovery_.cut_byte_count += next.value_or(data_end_) - offset;
  }
  return next.value_or(0);
}

expected<void, SetupError> Rescue::take_chunk(const UnpackedChunk& chunk) {
  expected<void, SetupError> copied{};
  const bool is_whole =
      for_each_record(chunk.records, [&](Opcode opcode, ConstBytes content, std::uint64_t) {
        copied = copy_.take(opcode, content);
        return copied.has_value();
      });
  if (!is_whole) ++recovery_.damaged_chunk_count;
  return copied;
}

/// Counts the messages of a lost chunk from the indexes after it.
void Rescue::lose_chunk(std::uint64_t end) {
  ++recovery_.damaged_chunk_count;
  constexpr std::uint64_t kHeadSize = 6;
  constexpr std::uint64_t kEntrySize = 16;
  for (auto index = file_.record_at(end); index && index->opcode == Opcode::kMessageIndex;
       index = file_.record_at(index->end())) {
    const auto head = file_.read(index->content_offset(), std::min(index->content_size, kHeadSize));
    if (!head) return;
    ByteReader reader(*head);
    const auto channel = reader.take<std::uint16_t>();
    const auto byte_count = reader.take<std::uint32_t>();
    if (reader.ok()) lost_[channel] += byte_count / kEntrySize;
  }
}

expected<void, SetupError> Rescue::say_what_is_lost() {
  if (recovery_.is_without_loss()) return {};
  Metadata metadata{.name = kRecoveryMetadata};
  metadata.values["from"] = utf8_of(path_of_utf8(file_.path()).filename());
  metadata.values["damaged_chunk_count"] = std::to_string(recovery_.damaged_chunk_count);
  metadata.values["cut_byte_count"] = std::to_string(recovery_.cut_byte_count);
  metadata.values["unknown_channel_count"] = std::to_string(recovery_.unknown_channel_count);
  for (const auto& [topic, count] : recovery_.lost_counts)
    metadata.values["lost." + topic] = std::to_string(count);
  for (const std::string& topic : recovery_.untyped_topics)
    metadata.values["untyped." + topic] = "its schema is lost";
  return writer_.write(metadata);
}

}  // namespace

expected<Recovery, SetupError> recover(const std::string& from, const std::string& to,
                                       const Progress& progress) {
  const auto file = InputFile::open(from);
  if (!file) return unexpected{file.error()};
  auto made = NewRecording::create(to);
  if (!made) return unexpected{made.error()};
  auto recovery = Rescue(*file, made->writer(), progress).run(to);
  if (!recovery) return recovery;
  const auto count = made->finish();
  if (!count) return unexpected{count.error()};
  recovery->message_count = *count;
  return recovery;
}

}  // namespace rtpm::recording
