#include "rtpm/recording/file_reader.hpp"

#include <algorithm>
#include <queue>
#include <utility>

#include "input_file.hpp"

namespace rtpm::recording {
namespace {

/// Records that are read at once: a chunk, or consecutive ones outside of chunks.
struct Block {
  std::uint64_t begin_ns = 0;  ///< Log time of its first message.
  RecordPlace chunk{};
  bool is_chunk = true;
  std::uint64_t begin = 0;  ///< If it is no chunk.
  std::uint64_t end = 0;
};

/// Longest block outside of chunks.
constexpr std::uint64_t kLooseByteMax = 1 << 20;

}  // namespace

struct FileReader::Impl {
  explicit Impl(InputFile opened) : file(std::move(opened)) {}

  expected<void, SetupError> open(Incomplete incomplete);
  expected<bool, SetupError> read_summary();
  expected<bool, SetupError> take_summary(ConstBytes summary);
  bool take_of_summary(Opcode opcode, ConstBytes content);
  expected<void, SetupError> scan();
  void take_loose(const RecordPlace& record);
  expected<void, SetupError> scan_chunk(const RecordPlace& chunk);
  void take(Opcode opcode, ConstBytes content, Block& block);
  expected<std::vector<std::byte>, SetupError> load(const Block& block) const;
  template <class T>
  expected<std::vector<T>, SetupError> read_all(const std::vector<RecordPlace>& places,
                                                std::optional<T> (*parse)(ConstBytes)) const;

  InputFile file;
  std::map<std::uint16_t, Schema> schemas{};
  std::map<std::uint16_t, Channel> channels{};
  Statistics statistics{};
  bool has_statistics = false;  ///< Stated by the summary.
  bool is_complete = false;
  std::vector<Block> blocks{};
  std::vector<RecordPlace> metadata{};
  std::vector<RecordPlace> attachments{};
};

namespace {

unexpected<SetupError> damaged(const InputFile& file, const std::string& why) {
  return setup_error("the recording " + file.path() + " is damaged", why, kRepair);
}

}  // namespace

expected<void, SetupError> FileReader::Impl::open(Incomplete incomplete) {
  const auto has_summary = read_summary();
  if (!has_summary) return unexpected{has_summary.error()};
  if (!is_complete && incomplete == Incomplete::kRefuse) {
    return setup_error("the recording " + file.path() + " was not ended",
                       "its recorder died, or still runs", kRepair);
  }
  if (!*has_summary) {
    if (auto scanned = scan(); !scanned) return scanned;
  }
  std::ranges::stable_sort(blocks, {}, &Block::begin_ns);
  return {};
}

/// Whether there is a summary through which the messages are found.
expected<bool, SetupError> FileReader::Impl::read_summary() {
  constexpr std::uint64_t kTailSize = kRecordHeaderSize + kFooterContentSize + kMagicSize;
  if (file.size() < kMagicSize + kTailSize) return false;
  const std::uint64_t footer_offset = file.size() - kTailSize;
  const auto tail = file.read(footer_offset, kTailSize);
  if (!tail) return unexpected{tail.error()};
  const ConstBytes magic = ConstBytes(*tail).last(kMagicSize);
  const auto opcode = static_cast<Opcode>((*tail)[0]);
  if (!std::ranges::equal(magic, std::as_bytes(std::span(kMagic))) || opcode != Opcode::kFooter) {
    return false;
  }
  is_complete = true;
  const auto footer =
      parse_footer(ConstBytes(*tail).subspan(kRecordHeaderSize, kFooterContentSize));
  if (footer->summary_begin == 0) return false;
  if (footer->summary_begin > footer_offset) return damaged(file, "its footer points behind it");
  const auto summary = file.read(footer->summary_begin, footer_offset - footer->summary_begin);
  if (!summary) return unexpected{summary.error()};
  const std::size_t checked_size = kRecordHeaderSize + kFooterContentSize - sizeof(std::uint32_t);
  const std::uint32_t crc = crc32(ConstBytes(*tail).first(checked_size), crc32(*summary));
  if (footer->summary_crc != 0 && footer->summary_crc != crc) {
    return damaged(file, "the checksum of its summary is wrong");
  }
  return take_summary(*summary);
}

expected<bool, SetupError> FileReader::Impl::take_summary(ConstBytes summary) {
  bool is_sound = true;
  const bool is_whole =
      for_each_record(summary, [&](Opcode opcode, ConstBytes content, std::uint64_t) {
        is_sound = take_of_summary(opcode, content);
        return is_sound;
      });
  if (!is_whole || !is_sound) return damaged(file, "its summary contradicts itself");
  // Without an index of chunks, messages may be anywhere.
  if (has_statistics && (!blocks.empty() || statistics.message_count == 0)) return true;
  blocks.clear();
  metadata.clear();
  attachments.clear();
  return false;
}

/// Whether the record is sound, and so is the place that it points to.
bool FileReader::Impl::take_of_summary(Opcode opcode, ConstBytes content) {
  if (opcode == Opcode::kChunkIndex) {
    const auto index = parse_chunk_index(content);
    const auto place = index ? file.record_at(index->chunk_offset) : std::nullopt;
    if (!place || place->opcode != Opcode::kChunk) return false;
    blocks.push_back({.begin_ns = index->begin_ns, .chunk = *place});
  } else if (opcode == Opcode::kStatistics) {
    const auto found = parse_statistics(content);
    if (!found) return false;
    statistics = *found;
    has_statistics = true;
  } else if (opcode == Opcode::kAttachmentIndex || opcode == Opcode::kMetadataIndex) {
    ByteReader reader(content);
    const auto place = file.record_at(reader.take<std::uint64_t>());
    if (!place || !reader.ok()) return false;
    (opcode == Opcode::kMetadataIndex ? metadata : attachments).push_back(*place);
  } else {
    Block none;
    take(opcode, content, none);
  }
  return true;
}

/// What a record says of the recording, and of the block that it is in.
void FileReader::Impl::take(Opcode opcode, ConstBytes content, Block& block) {
  if (opcode == Opcode::kSchema) {
    if (auto found = parse_schema(content)) schemas.insert(std::move(*found));
  } else if (opcode == Opcode::kChannel) {
    if (auto found = parse_channel(content)) channels.insert(std::move(*found));
  } else if (opcode == Opcode::kMessage) {
    const auto message = parse_message(content);
    if (!message) return;
    add(*message, statistics);
    block.begin_ns = std::min(block.begin_ns, message->log_time_ns);
  }
}

expected<void, SetupError> FileReader::Impl::scan() {
  statistics = {};
  expected<void, SetupError> scanned{};
  static_cast<void>(for_each_record(file, [&](const RecordPlace& record) {
    switch (record.opcode) {
      case Opcode::kChunk:
        scanned = scan_chunk(record);
        break;
      case Opcode::kMetadata:
        metadata.push_back(record);
        break;
      case Opcode::kAttachment:
        attachments.push_back(record);
        break;
      case Opcode::kSchema:
      case Opcode::kChannel:
      case Opcode::kMessage:
        take_loose(record);
        break;
      default:
        break;
    }
    return scanned.has_value();
  }));
  return scanned;
}

void FileReader::Impl::take_loose(const RecordPlace& record) {
  const auto content = file.content(record);
  if (!content) return;
  const bool goes_on = !blocks.empty() && !blocks.back().is_chunk &&
                       blocks.back().end == record.offset &&
                       record.end() - blocks.back().begin <= kLooseByteMax;
  if (!goes_on) {
    blocks.push_back({.begin_ns = UINT64_MAX, .is_chunk = false, .begin = record.offset});
  }
  blocks.back().end = record.end();
  take(record.opcode, *content, blocks.back());
}

expected<void, SetupError> FileReader::Impl::scan_chunk(const RecordPlace& chunk) {
  const auto records = unpack(file, chunk);
  if (!records) return unexpected{records.error()};
  Block block{.begin_ns = UINT64_MAX, .chunk = chunk};
  ++statistics.chunk_count;
  static_cast<void>(
      for_each_record(*records, [&](Opcode opcode, ConstBytes content, std::uint64_t) {
        take(opcode, content, block);
        return true;
      }));
  blocks.push_back(block);
  return {};
}

expected<std::vector<std::byte>, SetupError> FileReader::Impl::load(const Block& block) const {
  return block.is_chunk ? unpack(file, block.chunk)
                        : file.read(block.begin, block.end - block.begin);
}

expected<std::unique_ptr<FileReader>, SetupError> FileReader::open(const std::string& path,
                                                                   Incomplete incomplete) {
  auto file = InputFile::open(path);
  if (!file) return unexpected{file.error()};
  auto impl = std::make_unique<Impl>(std::move(*file));
  if (auto opened = impl->open(incomplete); !opened) return unexpected{opened.error()};
  return std::unique_ptr<FileReader>(new FileReader(std::move(impl)));
}

FileReader::FileReader(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
FileReader::~FileReader() = default;

const std::map<std::uint16_t, Schema>& FileReader::schemas() const noexcept {
  return impl_->schemas;
}
const std::map<std::uint16_t, Channel>& FileReader::channels() const noexcept {
  return impl_->channels;
}
const Statistics& FileReader::statistics() const noexcept {
  return impl_->statistics;
}
bool FileReader::is_complete() const noexcept {
  return impl_->is_complete;
}

namespace {

/// A message that is to be visited; blocks may overlap in time.
struct Candidate {
  std::uint64_t log_time_ns = 0;
  /// Block and offset in it: the order of writing among those of one time.
  std::pair<std::uint64_t, std::uint64_t> place{};
  std::shared_ptr<const std::vector<std::byte>> records{};
  ConstBytes content{};

  friend bool operator>(const Candidate& a, const Candidate& b) {
    return std::pair(a.log_time_ns, a.place) > std::pair(b.log_time_ns, b.place);
  }
};

bool is_wanted(const Query& query, const Message& message) {
  return message.log_time_ns >= query.from_ns && message.log_time_ns <= query.to_ns &&
         (query.channel_ids.empty() ||
          std::ranges::count(query.channel_ids, message.channel_id) > 0);
}

}  // namespace

expected<void, SetupError> FileReader::read(const Query& query,
                                            const std::function<bool(const Message&)>& visit) {
  std::priority_queue<Candidate, std::vector<Candidate>, std::greater<>> queue;
  const auto add = [&](const Block& block) -> expected<void, SetupError> {
    auto loaded = impl_->load(block);
    if (!loaded) return unexpected{loaded.error()};
    const auto records = std::make_shared<const std::vector<std::byte>>(std::move(*loaded));
    const std::uint64_t place = block.is_chunk ? block.chunk.offset : block.begin;
    const bool is_whole =
        for_each_record(*records, [&](Opcode opcode, ConstBytes content, std::uint64_t offset) {
          const auto message =
              opcode == Opcode::kMessage ? parse_message(content) : std::optional<Message>{};
          if (message && is_wanted(query, *message)) {
            queue.push({message->log_time_ns, {place, offset}, records, content});
          }
          return true;
        });
    if (!is_whole) return damaged(impl_->file, "a chunk has a record that is cut short");
    return {};
  };
  auto next = impl_->blocks.begin();
  while (next != impl_->blocks.end() || !queue.empty()) {
    while (next != impl_->blocks.end() &&
           (queue.empty() || next->begin_ns <= queue.top().log_time_ns)) {
      if (next->begin_ns > query.to_ns) {
        next = impl_->blocks.end();
        break;
      }
      if (auto added = add(*next++); !added) return added;
    }
    if (queue.empty()) continue;
    const Candidate first = queue.top();
    queue.pop();
    if (!visit(*parse_message(first.content))) return {};
  }
  return {};
}

template <class T>
expected<std::vector<T>, SetupError> FileReader::Impl::read_all(
    const std::vector<RecordPlace>& places, std::optional<T> (*parse)(ConstBytes)) const {
  std::vector<T> all;
  for (const RecordPlace& place : places) {
    const auto content = file.content(place);
    if (!content) return unexpected{content.error()};
    auto record = parse(*content);
    if (!record) {
      return damaged(file, "the record at byte " + std::to_string(place.offset) + " is unreadable");
    }
    all.push_back(std::move(*record));
  }
  return all;
}

expected<std::vector<Metadata>, SetupError> FileReader::read_metadata() {
  return impl_->read_all(impl_->metadata, &parse_metadata);
}

expected<std::vector<Attachment>, SetupError> FileReader::read_attachments() {
  return impl_->read_all(impl_->attachments, &parse_attachment);
}

}  // namespace rtpm::recording
