#include "rtpm/recording/recorder.hpp"

#include <array>
#include <atomic>
#include <cstring>
#include <ctime>
#include <mutex>
#include <span>
#include <utility>
#include <vector>

#include "rtpm/base/assert.hpp"
#include "rtpm/base/civil_time.hpp"
#include "rtpm/base/record_ring.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/pi_mutex.hpp"
#include "rtpm/rt/semaphore.hpp"
#include "rtpm/rt/thread.hpp"
#include "rtpm/rt/utc.hpp"

namespace rtpm::recording {
namespace {

/// The intervals at which the rings are emptied, and chunks of the file are ended.
constexpr Duration kPeriod = std::chrono::milliseconds{5};
constexpr Duration kChunkPeriod = std::chrono::seconds{1};
constexpr std::size_t kChannelCountMax = 65'536;

/// The header of a message in a ring; its bytes follow.
struct Head {
  std::uint64_t log_time_ns = 0;
  std::uint64_t publish_time_ns = 0;
  std::uint32_t sequence = 0;
  std::uint16_t channel_id = 0;
  std::uint16_t reserved = 0;
};
static_assert(sizeof(Head) == 24);

/// A ring's memory, aligned to a cache line.
class RingMemory {
 public:
  explicit RingMemory(std::size_t size)
      : control_(std::make_unique<RecordRingControl>()),
        lines_(kRecordSlotsSize / sizeof(Line) + size / sizeof(Line)),
        size_(size) {}
  [[nodiscard]] RecordRingMemory view() {
    const MutableBytes all = std::as_writable_bytes(std::span(lines_));
    return {*control_, all.first(kRecordSlotsSize), all.subspan(kRecordSlotsSize, size_)};
  }

 private:
  struct alignas(kRecordAlignment) Line {
    std::array<std::byte, kRecordAlignment> bytes{};
  };
  std::unique_ptr<RecordRingControl> control_;
  std::vector<Line> lines_;
  std::size_t size_;
};

using DropCounts = std::vector<std::atomic<std::uint64_t>>;

}  // namespace

struct Recorder::Track::Impl {
  Impl(const RecorderConfig& config, DropCounts& counts)
      : memory(config.ring_byte_count),
        writer(memory.view()),
        reader(memory.view()),
        draft(sizeof(Head) + config.message_byte_max),
        drop_counts(counts) {}

  RingMemory memory;
  RecordWriter writer;
  RecordReader reader;
  std::vector<std::byte> draft;  ///< Used by the thread that calls put().
  DropCounts& drop_counts;
};

Recorder::Track::Track(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
Recorder::Track::~Track() = default;

bool Recorder::Track::put(const Message& message) noexcept {
  const auto drop = [&] {
    impl_->drop_counts[message.channel_id].fetch_add(1, std::memory_order_relaxed);
    return false;
  };
  const std::size_t size = sizeof(Head) + message.data.size();
  if (size > impl_->draft.size()) return drop();
  const Head head{.log_time_ns = message.log_time_ns,
                  .publish_time_ns = message.publish_time_ns,
                  .sequence = message.sequence,
                  .channel_id = message.channel_id};
  std::memcpy(impl_->draft.data(), &head, sizeof head);
  if (!message.data.empty()) {
    std::memcpy(impl_->draft.data() + sizeof head, message.data.data(), message.data.size());
  }
  const auto outcome = impl_->writer.write(ConstBytes(impl_->draft).first(size));
  const bool is_written =
      outcome != RecordWriter::Outcome::kFull && outcome != RecordWriter::Outcome::kBroken;
  return is_written || drop();
}

struct Recorder::Impl {
  Impl(std::unique_ptr<FileWriter> file, const RecorderConfig& configuration)
      : config(configuration), writer(std::move(file)), drop_counts(kChannelCountMax) {
    const MonotonicTime now = rt::now();
    wall_offset_ns = static_cast<std::int64_t>(rt::utc_ns(now)) - to_ns(now);
  }

  /// Runs until close(): empties the rings, and ends a chunk every second.
  void run() {
    MonotonicTime chunk_end = rt::now() + kChunkPeriod;
    while (!ending.wait_until(rt::now() + kPeriod)) {
      const std::lock_guard lock(mutex);
      drain();
      if (rt::now() < chunk_end) continue;
      chunk_end = rt::now() + kChunkPeriod;
      note_drops();
      keep(writer->end_chunk());
    }
  }

  void drain() {
    std::vector<std::byte>& buffer = scratch;
    for (const std::unique_ptr<Track>& track : tracks) {
      while (true) {
        const auto size = track->impl_->reader.read(buffer);
        if (!size) {
          RTPM_ASSERT(size.error() == RecordError::kEmpty, "no one else writes to this ring");
          break;
        }
        write(ConstBytes(buffer).first(*size));
      }
    }
  }

  void write(ConstBytes record) {
    Head head;
    std::memcpy(&head, record.data(), sizeof head);
    if (problem) {
      drop_counts[head.channel_id].fetch_add(1, std::memory_order_relaxed);
      return;
    }
    keep(writer->write({.channel_id = head.channel_id,
                        .sequence = head.sequence,
                        .log_time_ns = head.log_time_ns,
                        .publish_time_ns = head.publish_time_ns,
                        .data = record.subspan(sizeof head)}));
    if (problem) drop_counts[head.channel_id].fetch_add(1, std::memory_order_relaxed);
  }

  void keep(const expected<void, SetupError>& outcome) {
    if (!outcome && !problem) problem = outcome.error();
  }

  [[nodiscard]] std::map<std::uint16_t, std::uint64_t> drops() const {
    std::map<std::uint16_t, std::uint64_t> counts;
    for (std::size_t i = 0; i < drop_counts.size(); ++i) {
      const std::uint64_t count = drop_counts[i].load(std::memory_order_relaxed);
      if (count > 0) counts[static_cast<std::uint16_t>(i)] = count;
    }
    return counts;
  }

  /// Writes the counts into the file if they have changed.
  void note_drops() {
    auto now = drops();
    if (now == noted_drops || problem) return;
    Metadata metadata{.name = "rtpm.recorder"};
    for (const auto& [channel, count] : now)
      metadata.values["dropped." + std::to_string(channel)] = std::to_string(count);
    keep(writer->write(metadata));
    noted_drops = std::move(now);
  }

  expected<void, SetupError> close() {
    {
      const std::lock_guard lock(mutex);
      if (std::exchange(is_closed, true)) return {};
    }
    ending.post();
    thread.join();
    const std::lock_guard lock(mutex);
    drain();
    note_drops();
    if (!problem) keep(writer->close());
    if (problem) return unexpected{*problem};
    return {};
  }

  RecorderConfig config;
  std::int64_t wall_offset_ns = 0;
  mutable rt::PiMutex mutex{};
  rt::Semaphore ending{};
  std::unique_ptr<FileWriter> writer;
  std::vector<std::unique_ptr<Track>> tracks{};
  std::vector<std::byte> scratch{};
  DropCounts drop_counts;
  std::map<std::uint16_t, std::uint64_t> noted_drops{};
  std::optional<SetupError> problem{};
  bool is_closed = false;
  rt::Thread thread{};
};

std::string name_by_time() {
  const std::tm parts = civil_utc(rt::utc_ns(rt::now()));
  std::array<char, 40> text{};
  std::strftime(text.data(), text.size(), "rtpm-%Y%m%d-%H%M%S.mcap", &parts);
  return text.data();
}

Recorder::Recorder(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}

Recorder::~Recorder() {
  static_cast<void>(impl_->close());
}

expected<std::unique_ptr<Recorder>, SetupError> Recorder::create(const std::string& path,
                                                                 RecorderConfig config) {
  RTPM_ASSERT(std::has_single_bit(config.ring_byte_count) &&
                  config.ring_byte_count >= 2 * record_span(sizeof(Head) + config.message_byte_max),
              "a ring is a power of two, and holds two of the longest messages");
  auto writer = FileWriter::create(path, config.writer);
  if (!writer) return unexpected{std::move(writer.error())};
  auto impl = std::make_unique<Impl>(std::move(*writer), config);
  impl->scratch.resize(sizeof(Head) + config.message_byte_max);
  auto thread = rt::Thread::start({.name = "rtpm-recorder", .realtime = rt::RealtimeMode::kOff},
                                  [&running = *impl] { running.run(); });
  if (!thread) return unexpected{std::move(thread.error())};
  impl->thread = std::move(*thread);
  return std::unique_ptr<Recorder>(new Recorder(std::move(impl)));
}

expected<std::uint16_t, SetupError> Recorder::add_schema(const Schema& schema) {
  const std::lock_guard lock(impl_->mutex);
  return impl_->writer->add_schema(schema);
}

expected<std::uint16_t, SetupError> Recorder::add_channel(const Channel& channel) {
  const std::lock_guard lock(impl_->mutex);
  return impl_->writer->add_channel(channel);
}

expected<void, SetupError> Recorder::write(const Metadata& metadata) {
  const std::lock_guard lock(impl_->mutex);
  if (!impl_->problem) impl_->keep(impl_->writer->write(metadata));
  if (impl_->problem) return unexpected{*impl_->problem};
  return {};
}

std::size_t Recorder::message_byte_max() const noexcept {
  return impl_->config.message_byte_max;
}

Recorder::Track& Recorder::add_track() {
  auto track = std::unique_ptr<Track>(
      new Track(std::make_unique<Track::Impl>(impl_->config, impl_->drop_counts)));
  const std::lock_guard lock(impl_->mutex);
  return *impl_->tracks.emplace_back(std::move(track));
}

std::uint64_t Recorder::log_time_ns(MonotonicTime time) const noexcept {
  return static_cast<std::uint64_t>(to_ns(time) + impl_->wall_offset_ns);
}

RecorderStatus Recorder::status() const {
  const std::lock_guard lock(impl_->mutex);
  RecorderStatus status{.message_count = impl_->writer->statistics().message_count,
                        .byte_count = impl_->writer->size(),
                        .drop_counts = impl_->drops(),
                        .problem = impl_->problem};
  for (const auto& [channel, count] : status.drop_counts)
    status.drop_count += count;
  return status;
}

expected<void, SetupError> Recorder::close() {
  return impl_->close();
}

}  // namespace rtpm::recording
