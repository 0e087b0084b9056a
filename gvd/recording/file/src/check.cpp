#include <algorithm>
#include <utility>

#include "contents.hpp"
#include "rtpm/recording/repair.hpp"

namespace rtpm::recording {
namespace {

constexpr std::size_t kProblemCountMax = 100;

/// Checks one recording.
class Examination {
 public:
  Examination(const InputFile& file, const Progress& progress)
      : file_(file), progress_([this, &progress](std::uint64_t done, std::uint64_t whole) {
          is_stopped_ = is_stopped_ || (progress && !progress(done, whole));
          return !is_stopped_;
        }) {}

  /// Returns the errors; nullopt if the check was stopped.
  std::optional<std::vector<std::string>> run() {
    const auto contents = read_contents(file_, Incomplete::kRead, progress_);
    if (contents) {
      check_data(*contents);
      check_blocks(*contents);
    } else {
      add(contents.error().reason());
    }
    if (is_stopped_) return std::nullopt;
    return std::move(problems_);
  }

 private:
  void add(std::string problem) {
    if (problems_.size() < kProblemCountMax) problems_.push_back(std::move(problem));
  }
  void check_data(const Contents& contents) {
    if (!contents.is_complete) return add("it was not ended");
    if (std::string problem = check_data_crc(); !problem.empty()) add(std::move(problem));
  }
  [[nodiscard]] std::string check_data_crc() const;
  [[nodiscard]] std::optional<RecordPlace> find_data_end() const;
  void check_blocks(const Contents& contents);
  void check_block(const Block& block, const Contents& contents);

  const InputFile& file_;
  bool is_stopped_ = false;
  Progress progress_;
  std::vector<std::string> problems_{};
  std::uint64_t message_count_ = 0;
  std::uint64_t unknown_count_ = 0;
};

/// The position of DataEnd; nullopt if the data section has no end.
std::optional<RecordPlace> Examination::find_data_end() const {
  std::optional<RecordPlace> found;
  std::uint64_t count = 0;
  static_cast<void>(for_each_record(file_, [&](const RecordPlace& record) {
    if (record.opcode == Opcode::kDataEnd) found = record;
    return ++count % kProgressStep != 0 || progress_(record.offset, file_.size());
  }));
  return found;
}

/// @return the error; empty if there is none
std::string Examination::check_data_crc() const {
  const auto data_end = find_data_end();
  if (!data_end) return "it has no end of its data";
  const auto content = file_.content(*data_end);
  const auto stated = content ? parse<DataEnd>(*content) : std::nullopt;
  if (!stated) return "the end of its data is unreadable";
  if (stated->data_crc == 0) return {};
  std::uint32_t crc = 0;
  constexpr std::uint64_t kStep = 1 << 20;
  for (std::uint64_t offset = 0; offset < data_end->offset; offset += kStep) {
    if (!progress_(offset, file_.size())) return {};
    const auto bytes = file_.read(offset, std::min(kStep, data_end->offset - offset));
    if (!bytes) return bytes.error().reason();
    crc = crc32(*bytes, crc);
  }
  return crc == stated->data_crc ? "" : "the checksum of its data is wrong";
}

void Examination::check_blocks(const Contents& contents) {
  std::vector<Block> blocks = contents.blocks;
  std::ranges::sort(blocks, {}, &Block::place);
  const std::size_t problem_count = problems_.size();
  for (const Block& block : blocks) {
    if (!progress_(block.place(), file_.size())) return;
    check_block(block, contents);
  }
  const std::uint64_t stated = contents.statistics.message_count;
  if (message_count_ != stated && problems_.size() == problem_count) {
    add("it has " + std::to_string(message_count_) + " messages, and states " +
        std::to_string(stated));
  }
  if (unknown_count_ > 0) {
    add(std::to_string(unknown_count_) + " messages have a channel that is not there");
  }
}

void Examination::check_block(const Block& block, const Contents& contents) {
  UnpackedChunk chunk{.begin_ns = block.begin_ns, .end_ns = block.end_ns};
  if (block.is_chunk) {
    auto unpacked = unpack(file_, block.chunk);
    if (!unpacked) return add(unpacked.error().reason());
    chunk = std::move(*unpacked);
    if (chunk.begin_ns == 0 && chunk.end_ns == 0) chunk.end_ns = UINT64_MAX;
  } else {
    auto records = file_.read(block.begin, block.end - block.begin);
    if (!records) return add(records.error().reason());
    chunk.records = std::move(*records);
  }
  const std::uint64_t from_ns = std::max(chunk.begin_ns, block.begin_ns);
  const std::uint64_t to_ns = std::min(chunk.end_ns, block.end_ns);
  bool is_outside = false;
  const bool is_whole =
      for_each_record(chunk.records, [&](Opcode opcode, ConstBytes content, std::uint64_t) {
        const auto message =
            opcode == Opcode::kMessage ? parse<Message>(content) : std::optional<Message>{};
        if (!message) return true;
        ++message_count_;
        if (!contents.channels.contains(message->channel_id)) ++unknown_count_;
        is_outside = is_outside || message->log_time_ns < from_ns || message->log_time_ns > to_ns;
        return true;
      });
  const std::string place = "the chunk at byte " + std::to_string(block.place());
  if (!is_whole) add(place + " has a record that is cut short");
  if (is_outside) add(place + " has messages outside of the times that are stated of it");
}

}  // namespace

expected<std::vector<std::string>, SetupError> check(const std::string& path,
                                                     const Progress& progress) {
  const auto file = InputFile::open(path);
  if (!file) return unexpected{file.error()};
  auto problems = Examination(*file, progress).run();
  if (!problems) return unexpected{stopped("the check of " + path)};
  return std::move(*problems);
}

}  // namespace rtpm::recording
