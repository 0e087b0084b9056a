#include "rtpm/recording/file_reader.hpp"

#include <algorithm>
#include <memory>
#include <span>
#include <utility>

#include "contents.hpp"

namespace rtpm::recording {
namespace {

/// A message of an open block.
struct Entry {
  std::uint64_t log_time_ns = 0;
  std::uint64_t offset = 0;  ///< Offset of its record in the block.
};

/// A block whose messages are being visited.
struct OpenBlock {
  std::uint64_t place = 0;
  std::vector<std::byte> records{};
  std::vector<Entry> entries{};  ///< Ordered by time, then by position.
  std::size_t next = 0;

  [[nodiscard]] std::uint64_t byte_count() const noexcept {
    return records.size() + entries.size() * sizeof(Entry);
  }
  [[nodiscard]] Message message() const {
    ByteReader reader(ConstBytes(records).subspan(entries[next].offset));
    static_cast<void>(reader.take<std::uint8_t>());
    return *parse<Message>(reader.take_bytes(reader.take<std::uint64_t>()));
  }
};

/// Orders the heap: the block with the next message is on top.
bool is_later(const std::unique_ptr<OpenBlock>& a, const std::unique_ptr<OpenBlock>& b) {
  return std::pair(a->entries[a->next].log_time_ns, a->place) >
         std::pair(b->entries[b->next].log_time_ns, b->place);
}

/// Reads the messages of possibly overlapping blocks in order of time.
class Merge {
 public:
  Merge(const InputFile& file, const Query& query)
      : file_(file), query_(query), is_wanted_(65'536, query.channel_ids.empty()) {
    for (const std::uint16_t channel : query.channel_ids)
      is_wanted_[channel] = true;
  }

  [[nodiscard]] bool is_empty() const noexcept { return open_.empty(); }
  /// Whether the block's index names a wanted channel, or there is no index.
  [[nodiscard]] bool is_wanted(const Block& block, const Contents& contents) const {
    const auto channels =
        std::span(contents.indexed_channels).subspan(block.first_channel, block.channel_count);
    return channels.empty() ||
           std::ranges::any_of(channels, [this](auto channel) { return is_wanted_[channel]; });
  }
  /// The log time of the next message.
  [[nodiscard]] std::uint64_t next_ns() const { return top().entries[top().next].log_time_ns; }
  [[nodiscard]] Message message() const { return top().message(); }

  expected<void, SetupError> add(const Block& block) {
    auto records = load(file_, block);
    if (!records) return unexpected{records.error()};
    auto open = std::make_unique<OpenBlock>(OpenBlock{block.place(), std::move(*records)});
    if (auto indexed = index(block, *open); !indexed) return indexed;
    if (open->entries.empty()) return {};
    std::ranges::stable_sort(open->entries, {}, &Entry::log_time_ns);
    byte_count_ += open->byte_count();
    if (byte_count_ > kHeldByteMax) {
      return setup_error("the recording " + file_.path() + " is not read",
                         "its chunks overlap in time by more than 512 MiB",
                         "read it with a tool of its writer");
    }
    open_.push_back(std::move(open));
    std::ranges::push_heap(open_, is_later);
    return {};
  }
  void pop() {
    std::ranges::pop_heap(open_, is_later);
    OpenBlock& block = *open_.back();
    if (++block.next < block.entries.size()) {
      std::ranges::push_heap(open_, is_later);
      return;
    }
    byte_count_ -= block.byte_count();
    open_.pop_back();
  }

 private:
  [[nodiscard]] const OpenBlock& top() const { return *open_.front(); }

  expected<void, SetupError> index(const Block& block, OpenBlock& open) const {
    bool is_outside = false;
    const bool is_whole = for_each_record(open.records, [&](Opcode opcode, ConstBytes content,
                                                            std::uint64_t offset) {
      if (opcode != Opcode::kMessage) return true;
      const auto message = parse<Message>(content);
      if (!message) return true;
      const std::uint64_t time_ns = message->log_time_ns;
      // Such messages come too late, or cannot be found by their time.
      is_outside =
          is_outside || time_ns < block.begin_ns || (time_ns > block.end_ns && query_.from_ns > 0);
      if (is_wanted_[message->channel_id] && time_ns >= query_.from_ns && time_ns <= query_.to_ns) {
        open.entries.push_back({time_ns, offset});
      }
      return true;
    });
    if (!is_whole) return damaged(file_, "a chunk has a record that is cut short");
    if (!is_outside) return {};
    return damaged(file_, "the chunk at byte " + std::to_string(block.place()) +
                              " has messages outside of the times that its index states");
  }

  const InputFile& file_;
  const Query& query_;
  std::vector<bool> is_wanted_;
  std::vector<std::unique_ptr<OpenBlock>> open_{};  ///< A heap by is_later().
  std::uint64_t byte_count_ = 0;
};

}  // namespace

struct FileReader::Impl {
  template <class T>
  expected<std::vector<T>, SetupError> read_all(const std::vector<RecordPlace>& places,
                                                std::uint64_t byte_max) const;

  InputFile file;
  Contents contents{};
};

expected<std::unique_ptr<FileReader>, SetupError> FileReader::open(const std::string& path,
                                                                   Incomplete incomplete,
                                                                   const Progress& progress) {
  auto file = InputFile::open(path);
  if (!file) return unexpected{file.error()};
  auto contents = read_contents(*file, incomplete, progress);
  if (!contents) return unexpected{contents.error()};
  return std::unique_ptr<FileReader>(
      new FileReader(std::make_unique<Impl>(Impl{std::move(*file), std::move(*contents)})));
}

FileReader::FileReader(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
FileReader::~FileReader() = default;

const std::map<std::uint16_t, Schema>& FileReader::schemas() const noexcept {
  return impl_->contents.schemas;
}
const std::map<std::uint16_t, Channel>& FileReader::channels() const noexcept {
  return impl_->contents.channels;
}
const Statistics& FileReader::statistics() const noexcept {
  return impl_->contents.statistics;
}
bool FileReader::is_complete() const noexcept {
  return impl_->contents.is_complete;
}

expected<void, SetupError> FileReader::read(const Query& query,
                                            const std::function<bool(const Message&)>& visit,
                                            const Progress& progress) {
  const std::vector<Block>& blocks = impl_->contents.blocks;
  Merge merge(impl_->file, query);
  std::size_t next = 0;
  while (true) {
    while (next < blocks.size() && (merge.is_empty() || blocks[next].begin_ns <= merge.next_ns())) {
      const Block& block = blocks[next++];
      if (block.begin_ns > query.to_ns) {
        next = blocks.size();
        break;
      }
      if (block.end_ns < query.from_ns || !merge.is_wanted(block, impl_->contents)) continue;
      if (progress && !progress(next - 1, blocks.size())) {
        return unexpected{stopped("the reading of " + impl_->file.path())};
      }
      if (auto added = merge.add(block); !added) return added;
    }
    if (merge.is_empty()) return {};
    if (!visit(merge.message())) return {};
    merge.pop();
  }
}

template <class T>
expected<std::vector<T>, SetupError> FileReader::Impl::read_all(
    const std::vector<RecordPlace>& places, std::uint64_t byte_max) const {
  std::vector<T> all;
  std::uint64_t byte_count = 0;
  for (const RecordPlace& place : places) {
    byte_count += place.content_size;
    if (byte_count > byte_max) {
      return setup_error(
          "the recording " + file.path() + " is not read",
          "its metadata or attachments are above " + std::to_string(byte_max >> 20) + " MiB",
          "read it with a tool of its writer");
    }
    const auto content = file.content(place);
    if (!content) return unexpected{content.error()};
    auto record = parse<T>(*content);
    if (!record) {
      return damaged(file, "the record at byte " + std::to_string(place.offset) + " is unreadable");
    }
    all.push_back(std::move(*record));
  }
  return all;
}

expected<std::vector<Metadata>, SetupError> FileReader::read_metadata() {
  return impl_->read_all<Metadata>(impl_->contents.metadata, kDescriptionByteMax);
}

expected<std::vector<Attachment>, SetupError> FileReader::read_attachments() {
  return impl_->read_all<Attachment>(impl_->contents.attachments, kHeldByteMax);
}

}  // namespace rtpm::recording
