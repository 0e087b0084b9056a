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
/// The span before a sought time that is shown, and its density: enough for curves.
constexpr std::uint64_t kHistoryNs = 30'000'000'000;
constexpr std::uint64_t kHistoryStepNs = 150'000'000;
/// Messages that are delivered in one batch: a browser's queue holds 256.
constexpr int kHistoryBatch = 64;

std::string text_of(ConstBytes bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

/// The reason why a page can't show it; empty if it can.
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

std::chrono::steady_clock::time_point steady(MonotonicTime time) {
  return std::chrono::steady_clock::time_point(time.time_since_epoch());
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
  auto thread = rt::Thread::start({.name = "console-replay", .realtime = rt::RealtimeMode::kOff},
                                  [raw = player.get()] { raw->run(); });
  if (!thread) return unexpected{thread.error()};
  player->thread_ = std::move(*thread);
  return player;
}

ReplayPlayer::ReplayPlayer(std::unique_ptr<recording::FileReader> reader, Deliver deliver)
    : reader_(std::move(reader)),
      deliver_(std::move(deliver)),
      begin_ns_(reader_->statistics().begin_ns),
      end_ns_(reader_->statistics().end_ns),
      channels_(reader_->channels()),
      schemas_(reader_->schemas()) {
  const double seconds = std::max(static_cast<double>(end_ns_ - begin_ns_) / 1e9, 1e-3);
  for (const auto& [channel, count] : reader_->statistics().message_counts)
    is_dense_[channel] = static_cast<double>(count) / seconds > kDenseRateHz;
  status_.time_ns = begin_ns_;
}

ReplayPlayer::~ReplayPlayer() {
  {
    const std::lock_guard lock(mutex_);
    is_stopping_ = true;
    ++turn_;
  }
  changed_.notify_all();
}

void ReplayPlayer::play(double speed) {
  {
    const std::lock_guard lock(mutex_);
    if (status_.time_ns >= end_ns_) status_.time_ns = begin_ns_;
    status_.speed = std::clamp(speed, kSpeedMin, kSpeedMax);
    status_.is_playing = true;
    ++turn_;
  }
  changed_.notify_all();
}

void ReplayPlayer::pause() {
  {
    const std::lock_guard lock(mutex_);
    status_.is_playing = false;
    ++turn_;
  }
  changed_.notify_all();
}

void ReplayPlayer::seek(std::uint64_t time_ns) {
  {
    const std::lock_guard lock(mutex_);
    status_.time_ns = std::clamp(time_ns, begin_ns_, std::max(begin_ns_, end_ns_));
    sought_ns_ = status_.time_ns;
    ++turn_;
  }
  changed_.notify_all();
}

ReplayPlayer::Status ReplayPlayer::status() const {
  const std::lock_guard lock(mutex_);
  return status_;
}

void ReplayPlayer::run() {
  std::unique_lock lock(mutex_);
  while (!is_stopping_) {
    if (sought_ns_) {
      const std::uint64_t moment = *std::exchange(sought_ns_, std::nullopt);
      const std::uint64_t turn = turn_;
      lock.unlock();
      show_moment(moment, turn);
      lock.lock();
    } else if (status_.is_playing) {
      const std::uint64_t from_ns = status_.time_ns;
      const std::uint64_t turn = turn_;
      anchor_ = rt::now();
      anchor_ns_ = from_ns;
      lock.unlock();
      play_on(from_ns, turn);
      lock.lock();
    } else {
      const std::uint64_t turn = turn_;
      changed_.wait(lock, [&] { return turn_ != turn; });
    }
  }
}

bool ReplayPlayer::is_present(std::uint64_t turn) const {
  const std::lock_guard lock(mutex_);
  return turn_ == turn;
}

void ReplayPlayer::show_moment(std::uint64_t time_ns, std::uint64_t turn) {
  std::map<std::uint16_t, std::pair<std::uint64_t, std::string>> newest;
  std::map<std::uint16_t, std::uint64_t> next_ns;
  int batch_count = 0;
  bool is_interrupted = false;
  const recording::Query query{.from_ns = time_ns > kHistoryNs ? time_ns - kHistoryNs : 0,
                               .to_ns = time_ns};
  const auto read = reader_->read(
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
        if (++batch_count % kHistoryBatch == 0) is_interrupted = !pause_delivery(turn);
        return !is_interrupted;
      },
      [&](std::uint64_t, std::uint64_t) { return is_present(turn); });
  if (is_interrupted || !is_present(turn)) return;
  for (auto& [channel, message] : newest)
    deliver_(channel, message.first, std::move(message.second));
  if (read) return;
  const std::lock_guard lock(mutex_);
  status_.problem = read.error().reason();
}

bool ReplayPlayer::pause_delivery(std::uint64_t turn) {
  std::unique_lock lock(mutex_);
  return !changed_.wait_until(lock, steady(rt::now() + kFrameInterval),
                              [&] { return turn_ != turn; });
}

void ReplayPlayer::play_on(std::uint64_t from_ns, std::uint64_t turn) {
  bool is_interrupted = false;
  const auto read = reader_->read(
      {.from_ns = from_ns},
      [&](const recording::Message& message) {
        is_interrupted = !wait_for(message.log_time_ns, turn);
        if (!is_interrupted && is_shown(message.channel_id)) {
          deliver_(message.channel_id, message.log_time_ns, text_of(message.data));
        }
        return !is_interrupted;
      },
      [&](std::uint64_t, std::uint64_t) { return is_present(turn); });
  const std::lock_guard lock(mutex_);
  if (is_interrupted || turn_ != turn) return;
  // The file is at its end, or damaged here.
  if (!read) status_.problem = read.error().reason();
  status_.is_playing = false;
  if (read) status_.time_ns = end_ns_;
}

bool ReplayPlayer::wait_for(std::uint64_t log_time_ns, std::uint64_t turn) {
  std::unique_lock lock(mutex_);
  const auto ahead_ns = static_cast<double>(log_time_ns - std::min(log_time_ns, anchor_ns_));
  // A file may state any time; a message that is due in years is never due.
  constexpr double kLongestNs = 1e18;
  const MonotonicTime due =
      anchor_ +
      Duration{static_cast<Duration::rep>(std::min(ahead_ns / status_.speed, kLongestNs))};
  if (changed_.wait_until(lock, steady(due), [&] { return turn_ != turn; })) return false;
  status_.time_ns = log_time_ns;
  return true;
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
