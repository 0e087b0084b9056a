#include "contents.hpp"

#include <algorithm>
#include <utility>

namespace rtpm::recording {
namespace {

/// Longest block outside chunks.
constexpr std::uint64_t kLooseByteMax = 1 << 20;
constexpr std::uint64_t kTailSize = kRecordHeaderSize + kFooterContentSize + kMagicSize;

/// Finds the contents of one file.
class Finder {
 public:
  Finder(const InputFile& file, const Progress& progress) : file_(file), progress_(progress) {}

  expected<Contents, SetupError> find(Incomplete incomplete);

 private:
  expected<bool, SetupError> take_summary(const SummaryPlace& place);
  bool take_of_summary(Opcode opcode, ConstBytes content);
  [[nodiscard]] bool has_sound_places(std::uint64_t summary_begin) const;
  [[nodiscard]] bool is_sufficient() const;
  expected<void, SetupError> scan();
  expected<void, SetupError> take_record(const RecordPlace& record);
  expected<void, SetupError> take_loose(const RecordPlace& record);
  expected<void, SetupError> scan_chunk(const RecordPlace& chunk);
  void take(Opcode opcode, ConstBytes content, Block& block);
  void describe(Opcode opcode, ConstBytes content);
  [[nodiscard]] expected<void, SetupError> check_limits() const;
  [[nodiscard]] bool goes_on(std::uint64_t done, std::uint64_t whole) const {
    return !progress_ || progress_(done, whole);
  }
  [[nodiscard]] unexpected<SetupError> stop() const {
    return unexpected{stopped("the reading of " + file_.path())};
  }

  const InputFile& file_;
  const Progress& progress_;
  Contents found_{};
  std::optional<StatedStatistics> stated_{};
  std::vector<bool> is_indexed_ = std::vector<bool>(65'536);  ///< Channels that an index names.
  std::uint64_t described_byte_count_ = 0;
};

expected<Contents, SetupError> Finder::find(Incomplete incomplete) {
  const auto summary = find_summary(file_);
  if (!summary) return unexpected{summary.error()};
  found_.is_complete = summary->has_value();
  if (!found_.is_complete && incomplete == Incomplete::kRefuse) {
    return setup_error("the recording " + file_.path() + " was not ended",
                       "its recorder died, or still runs", kRepair);
  }
  bool is_found = false;
  if (*summary && (*summary)->begin < (*summary)->end) {
    const auto taken = take_summary(**summary);
    if (!taken) return unexpected{taken.error()};
    is_found = *taken;
  }
  if (!is_found) {
    if (auto scanned = scan(); !scanned) return unexpected{scanned.error()};
  }
  std::ranges::stable_sort(found_.blocks, {}, &Block::begin_ns);
  return std::move(found_);
}

/// Reads the summary. Returns whether it covers the whole recording.
expected<bool, SetupError> Finder::take_summary(const SummaryPlace& place) {
  const auto summary = read_summary(file_, place);
  if (!summary) return unexpected{summary.error()};
  bool is_sound = true;
  const bool is_whole =
      for_each_record(*summary, [&](Opcode opcode, ConstBytes content, std::uint64_t) {
        is_sound = take_of_summary(opcode, content);
        return is_sound;
      });
  if (auto within = check_limits(); !within) return unexpected{within.error()};
  if (!is_whole || !is_sound || !has_sound_places(place.begin)) {
    return damaged(file_, "its summary contradicts itself");
  }
  if (is_sufficient()) return true;
  found_.blocks.clear();
  found_.indexed_channels.clear();
  found_.metadata.clear();
  found_.attachments.clear();
  return false;
}

/// Returns whether the record is valid, and its position exists.
bool Finder::take_of_summary(Opcode opcode, ConstBytes content) {
  if (opcode == Opcode::kChunkIndex) {
    auto index = parse<ChunkIndex>(content);
    const auto place = index ? file_.record_at(index->chunk_offset) : std::nullopt;
    if (!place || place->opcode != Opcode::kChunk) return false;
    // The messages of a chunk without stated times may have any time.
    if (index->begin_ns == 0 && index->end_ns == 0) index->end_ns = UINT64_MAX;
    found_.blocks.push_back({.begin_ns = index->begin_ns,
                             .end_ns = index->end_ns,
                             .chunk = *place,
                             .first_channel = found_.indexed_channels.size(),
                             .channel_count = index->index_offsets.size()});
    for (const auto& [channel, offset] : index->index_offsets) {
      is_indexed_[channel] = true;
      found_.indexed_channels.push_back(channel);
    }
  } else if (opcode == Opcode::kStatistics) {
    auto stated = parse<StatedStatistics>(content);
    if (!stated) return false;
    found_.statistics = stated->statistics;
    stated_ = std::move(*stated);
  } else if (opcode == Opcode::kAttachmentIndex || opcode == Opcode::kMetadataIndex) {
    const bool is_metadata = opcode == Opcode::kMetadataIndex;
    ByteReader reader(content);
    const auto place = file_.record_at(reader.take<std::uint64_t>());
    if (!reader.ok()) return false;
    // @mcap/core states a wrong position if it writes no chunks.
    if (place && place->opcode == (is_metadata ? Opcode::kMetadata : Opcode::kAttachment)) {
      (is_metadata ? found_.metadata : found_.attachments).push_back(*place);
    }
  } else {
    describe(opcode, content);
  }
  return check_limits().has_value();
}

/// Whether all positions are in the data and do not overlap, so that no record is read repeatedly.
bool Finder::has_sound_places(std::uint64_t summary_begin) const {
  std::vector<std::pair<std::uint64_t, std::uint64_t>> places;
  for (const Block& block : found_.blocks)
    places.emplace_back(block.chunk.offset, block.chunk.end());
  for (const auto* const list : {&found_.metadata, &found_.attachments}) {
    for (const RecordPlace& place : *list)
      places.emplace_back(place.offset, place.end());
  }
  std::ranges::sort(places);
  std::uint64_t end = kMagicSize;
  for (const auto& [from, to] : places) {
    if (from < end || to > summary_begin) return false;
    end = to;
  }
  return true;
}

/// Whether the summary has everything needed: it may omit indexes of chunks or extras, and
/// descriptions that the chunks have.
bool Finder::is_sufficient() const {
  if (!stated_ || stated_->attachment_count > found_.attachments.size() ||
      stated_->metadata_count > found_.metadata.size() ||
      stated_->channel_count > found_.channels.size() ||
      stated_->schema_count > found_.schemas.size()) {
    return false;
  }
  // Without an index of chunks, messages may be anywhere.
  if (found_.blocks.empty() && found_.statistics.message_count > 0) return false;
  for (std::size_t channel = 0; channel < is_indexed_.size(); ++channel) {
    const bool is_known = found_.channels.contains(static_cast<std::uint16_t>(channel));
    if (is_indexed_[channel] && !is_known) return false;
  }
  for (const auto& [channel, count] : found_.statistics.message_counts) {
    if (count > 0 && !found_.channels.contains(channel)) return false;
  }
  return std::ranges::all_of(found_.channels, [&](const auto& channel) {
    const std::uint16_t schema = channel.second.schema_id;
    return schema == 0 || found_.schemas.contains(schema);
  });
}

expected<void, SetupError> Finder::scan() {
  found_.statistics = {};
  expected<void, SetupError> scanned{};
  std::uint64_t count = 0;
  static_cast<void>(for_each_record(file_, [&](const RecordPlace& record) {
    const bool is_reported = record.opcode == Opcode::kChunk || ++count % kProgressStep == 0;
    if (is_reported && !goes_on(record.offset, file_.size())) {
      scanned = stop();
    } else {
      scanned = take_record(record);
    }
    if (scanned) scanned = check_limits();
    return scanned.has_value();
  }));
  return scanned;
}

expected<void, SetupError> Finder::take_record(const RecordPlace& record) {
  switch (record.opcode) {
    case Opcode::kChunk:
      return scan_chunk(record);
    case Opcode::kMetadata:
      found_.metadata.push_back(record);
      return {};
    case Opcode::kAttachment:
      found_.attachments.push_back(record);
      return {};
    case Opcode::kSchema:
    case Opcode::kChannel:
    case Opcode::kMessage:
      return take_loose(record);
    default:
      return {};
  }
}

expected<void, SetupError> Finder::take_loose(const RecordPlace& record) {
  const auto content = file_.content(record);
  if (!content) return unexpected{content.error()};
  std::vector<Block>& blocks = found_.blocks;
  const bool goes_on_there = !blocks.empty() && !blocks.back().is_chunk &&
                             blocks.back().end == record.offset &&
                             record.end() - blocks.back().begin <= kLooseByteMax;
  if (!goes_on_there) {
    blocks.push_back({.begin_ns = UINT64_MAX, .is_chunk = false, .begin = record.offset});
  }
  blocks.back().end = record.end();
  take(record.opcode, *content, blocks.back());
  return {};
}

expected<void, SetupError> Finder::scan_chunk(const RecordPlace& chunk) {
  const auto unpacked = unpack(file_, chunk);
  if (!unpacked) return unexpected{unpacked.error()};
  Block block{.begin_ns = UINT64_MAX, .chunk = chunk};
  ++found_.statistics.chunk_count;
  static_cast<void>(
      for_each_record(unpacked->records, [&](Opcode opcode, ConstBytes content, std::uint64_t) {
        take(opcode, content, block);
        return true;
      }));
  found_.blocks.push_back(block);
  return {};
}

/// Handles a record about the recording, or about its enclosing block.
void Finder::take(Opcode opcode, ConstBytes content, Block& block) {
  if (opcode != Opcode::kMessage) return describe(opcode, content);
  const auto message = parse<Message>(content);
  if (!message) return;
  add(*message, found_.statistics);
  block.begin_ns = std::min(block.begin_ns, message->log_time_ns);
  block.end_ns = std::max(block.end_ns, message->log_time_ns);
}

void Finder::describe(Opcode opcode, ConstBytes content) {
  bool is_new = false;
  if (opcode == Opcode::kSchema) {
    if (auto found = parse<NumberedSchema>(content))
      is_new = found_.schemas.insert(std::move(*found)).second;
  } else if (opcode == Opcode::kChannel) {
    if (auto found = parse<NumberedChannel>(content)) {
      is_new = found_.channels.insert(std::move(*found)).second;
    }
  }
  if (is_new) described_byte_count_ += content.size();
}

expected<void, SetupError> Finder::check_limits() const {
  const auto above = [this](const char* what) {
    return setup_error("the recording " + file_.path() + " is not read", what,
                       "cut what you need from it with a tool of its writer");
  };
  const std::size_t most =
      std::max({found_.blocks.size(), found_.metadata.size(), found_.attachments.size()});
  if (most > kPlaceCountMax) return above("it has more than 1048576 parts");
  if (described_byte_count_ > kDescriptionByteMax) {
    return above("its schemas and channels take more than 64 MiB");
  }
  return {};
}

}  // namespace

unexpected<SetupError> damaged(const InputFile& file, const std::string& why) {
  return setup_error("the recording " + file.path() + " is damaged", why, kRepair);
}

expected<std::optional<SummaryPlace>, SetupError> find_summary(const InputFile& file) {
  if (file.size() < kMagicSize + kTailSize) return std::nullopt;
  const std::uint64_t footer_offset = file.size() - kTailSize;
  const auto tail = file.read(footer_offset, kTailSize);
  if (!tail) return unexpected{tail.error()};
  const ConstBytes magic = ConstBytes(*tail).last(kMagicSize);
  const auto opcode = static_cast<Opcode>((*tail)[0]);
  if (!std::ranges::equal(magic, std::as_bytes(std::span(kMagic))) || opcode != Opcode::kFooter) {
    return std::nullopt;
  }
  const auto footer =
      parse<Footer>(ConstBytes(*tail).subspan(kRecordHeaderSize, kFooterContentSize));
  if (footer->summary_begin == 0) return SummaryPlace{};
  if (footer->summary_begin > footer_offset) return damaged(file, "its footer points behind it");
  return SummaryPlace{footer->summary_begin, footer_offset};
}

expected<std::vector<std::byte>, SetupError> read_summary(const InputFile& file,
                                                          const SummaryPlace& place) {
  auto summary = file.read(place.begin, place.end - place.begin);
  if (!summary) return summary;
  const auto tail = file.read(place.end, kTailSize);
  if (!tail) return unexpected{tail.error()};
  const auto footer =
      parse<Footer>(ConstBytes(*tail).subspan(kRecordHeaderSize, kFooterContentSize));
  const std::size_t checked_size = kRecordHeaderSize + kFooterContentSize - sizeof(std::uint32_t);
  const std::uint32_t crc = crc32(ConstBytes(*tail).first(checked_size), crc32(*summary));
  if (footer->summary_crc != 0 && footer->summary_crc != crc) {
    return damaged(file, "the checksum of its summary is wrong");
  }
  return summary;
}

expected<Contents, SetupError> read_contents(const InputFile& file, Incomplete incomplete,
                                             const Progress& progress) {
  return Finder(file, progress).find(incomplete);
}

expected<std::vector<std::byte>, SetupError> load(const InputFile& file, const Block& block) {
  if (!block.is_chunk) return file.read(block.begin, block.end - block.begin);
  auto unpacked = unpack(file, block.chunk);
  if (!unpacked) return unexpected{unpacked.error()};
  return std::move(unpacked->records);
}

expected<Outline, SetupError> read_outline(const std::string& path) {
  const auto file = InputFile::open(path);
  if (!file) return unexpected{file.error()};
  const auto summary = find_summary(*file);
  if (!summary) return unexpected{summary.error()};
  Outline outline{.is_complete = summary->has_value()};
  if (!outline.is_complete) return outline;
  constexpr int kRecordCountMax = 1 << 16;
  std::uint64_t offset = (*summary)->begin;
  for (int i = 0; i < kRecordCountMax && offset < (*summary)->end; ++i) {
    const auto record = file->record_at(offset);
    if (!record) break;
    offset = record->end();
    if (record->opcode != Opcode::kStatistics) continue;
    const auto content = file->content(*record);
    auto stated = content ? parse<StatedStatistics>(*content) : std::nullopt;
    if (stated) outline.statistics = std::move(stated->statistics);
    break;
  }
  return outline;
}

}  // namespace rtpm::recording
