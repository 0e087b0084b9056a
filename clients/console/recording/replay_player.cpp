#include "recording/replay_player.hpp"

#include <algorithm>
#include <utility>

#include "rtpm/rt/clock.hpp"

namespace rtpm::console {
namespace {

constexpr Duration kFrameInterval = std::chrono::milliseconds{16};
constexpr double kDenseRateHz = 100;
constexpr double kSpeedMin = 0.01;
constexpr double kSpeedMax = 100;
/// How much before a seek time is shown, and at what density: enough for curves.
constexpr std::uint64_t kHistoryNs = 30'000'000'000;
constexpr std::uint64_t kHistoryStepNs = 150'000'000;
/// Messages delivered in one batch; a browser's queue holds 256.
constexpr int kHistoryBatch = 64;

std::string text_of(ConstBytes bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

/// Why a page can't show the recording; empty if it can.
std::string excess_of(const recording::FileReader& reader) {
  std::size_t byte_count = 0;
  for (const auto& [number, schema] : reader.schemas())
    byte_count += schema.data.size();
  const std::size_t count = reader.channels().size();
  if (count > ReplayPlayer::kChannelCountMax) {
    return "it has " + std::to_string(count) + " topics, and a page shows at most " +
           std::to_string(ReplayPlayer::kChannelCountMax);
  }
  return byte_count > ReplayPlayer::kSchemaByteMax ? "its schemas take more than 16 MiB" : "";
}

/// A file may contain any times, but the difference of any two fits a Duration.
Duration between(std::uint64_t begin_ns, std::uint64_t end_ns) noexcept {
  constexpr std::uint64_t kLongestNs = 1'000'000'000'000'000'000;
  return Duration{
      static_cast<Duration::rep>(std::min(end_ns - std::min(begin_ns, end_ns), kLongestNs))};
}

}  // namespace

expected<std::unique_ptr<ReplayPlayer>, SetupError> ReplayPlayer::open(
    const std::string& path, Deliver deliver, const recording::Progress& progress) {
  auto reader = recording::FileReader::open(path, recording::Incomplete::kRead, progress);
  if (!reader) return unexpected{reader.error()};
  if (std::string excess = excess_of(**reader); !excess.empty()) {
    return setup_error("the recording " + path + " is not shown", std::move(excess),
                       "cut the topics that you need: rtpm bag cut --topics");
  }
  std::unique_ptr<ReplayPlayer> player(new ReplayPlayer(std::move(*reader), std::move(deliver)));
  if (auto started = player->playback_.start(); !started) return unexpected{started.error()};
  return player;
}

ReplayPlayer::ReplayPlayer(std::unique_ptr<recording::FileReader> reader, Deliver deliver)
    : reader_(std::move(reader)),
      deliver_(std::move(deliver)),
      begin_ns_(reader_->statistics().begin_ns),
      end_ns_(reader_->statistics().end_ns),
      channels_(reader_->channels()),
      schemas_(reader_->schemas()),
      playback_(*this, {.length = between(begin_ns_, end_ns_)}) {
  const double seconds = std::max(static_cast<double>(end_ns_ - begin_ns_) / 1e9, 1e-3);
  for (const auto& [channel, count] : reader_->statistics().message_counts)
    is_dense_[channel] = static_cast<double>(count) / seconds > kDenseRateHz;
}

Duration ReplayPlayer::at(std::uint64_t log_time_ns) const noexcept {
  return between(begin_ns_, log_time_ns);
}

std::uint64_t ReplayPlayer::time_ns(Duration at) const noexcept {
  return begin_ns_ + static_cast<std::uint64_t>(at.count());
}

void ReplayPlayer::play(double speed) {
  playback_.play(std::clamp(speed, kSpeedMin, kSpeedMax));
}

expected<void, SetupError> ReplayPlayer::play(Duration from, const replay::Turn& turn) {
  return reader_->read(
      {.from_ns = time_ns(from)},
      [&](const recording::Message& message) {
        if (!turn.reach(at(message.log_time_ns))) return false;
        if (is_shown(message.channel_id)) {
          deliver_(message.channel_id, message.log_time_ns, text_of(message.data));
        }
        return true;
      },
      [&](std::uint64_t, std::uint64_t) { return turn.is_present(); });
}

expected<void, SetupError> ReplayPlayer::show(Duration at, const replay::Turn& turn) {
  std::map<std::uint16_t, std::pair<std::uint64_t, std::string>> newest;
  std::map<std::uint16_t, std::uint64_t> next_ns;
  int batch_count = 0;
  const std::uint64_t sought_ns = time_ns(at);
  const recording::Query query{.from_ns = sought_ns > kHistoryNs ? sought_ns - kHistoryNs : 0,
                               .to_ns = sought_ns};
  auto read = reader_->read(
      query,
      [&](const recording::Message& message) {
        std::uint64_t& next = next_ns[message.channel_id];
        if (message.log_time_ns < next) {
          newest[message.channel_id] = {message.log_time_ns, text_of(message.data)};
          return true;
        }
        next = message.log_time_ns + kHistoryStepNs;
        newest.erase(message.channel_id);
        deliver_(message.channel_id, message.log_time_ns, text_of(message.data));
        // Gives browsers time to receive the batch.
        return ++batch_count % kHistoryBatch != 0 || turn.wait(kFrameInterval);
      },
      [&](std::uint64_t, std::uint64_t) { return turn.is_present(); });
  if (!turn.is_present()) return {};
  for (auto& [channel, message] : newest)
    deliver_(channel, message.first, std::move(message.second));
  return read;
}

bool ReplayPlayer::is_shown(std::uint16_t channel) {
  if (!is_dense_[channel]) return true;
  const MonotonicTime now = rt::now();
  MonotonicTime& shown = shown_[channel];
  if (now - shown < kFrameInterval) return false;
  shown = now;
  return true;
}

}  // namespace rtpm::console
