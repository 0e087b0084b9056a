#include "timeline.hpp"

#include <algorithm>
#include <map>
#include <optional>
#include <utility>

#include "rtpm/program/text.hpp"

namespace rtpm::replay {
namespace {

/// The largest plausible difference between origin and recording time of a message.
constexpr std::uint64_t kDelayMaxNs = 10'000'000'000;

std::string seconds(Duration time) {
  return program::formatted("%.3f s", std::chrono::duration<double>(time).count());
}

/// How far an origin may go back, because messages take different times to reach the recorder.
constexpr Duration kJitterMax = std::chrono::milliseconds{10};

/// Makes times monotonic, and counts the corrections.
class Rising {
 public:
  explicit Rising(std::string what) : what_(std::move(what)) {}
  Duration next(Duration time) {
    if (!begin_) begin_ = time;
    if (time < newest_) {
      if (count_++ == 0) first_ = newest_ - *begin_;
      most_ = std::max(most_, newest_ - time);
      return newest_;
    }
    return newest_ = time;
  }
  void tell(std::vector<std::string>& notes) const {
    if (most_ <= kJitterMax) return;
    notes.push_back(what_ + ": the time goes back, first at " + seconds(first_) + ", by at most " +
                    seconds(most_) + "; " + std::to_string(count_) +
                    " messages are played at once instead");
  }

 private:
  std::string what_;
  std::optional<Duration> begin_{};
  Duration newest_ = Duration::min();
  std::uint64_t count_ = 0;
  Duration first_{};
  Duration most_{};
};

std::vector<Duration> all_times(const Recorded& recorded) {
  std::vector<Duration> times;
  for (const RecordedDevice& device : recorded.devices)
    times.insert(times.end(), device.times.begin(), device.times.end());
  for (const RecordedEvent& event : recorded.events)
    times.push_back(event.at);
  std::ranges::sort(times);
  return times;
}

/// The amount that later times are moved back, from a certain time on.
class Cuts {
 public:
  Cuts(Recorded& recorded, const std::vector<Duration>& times) {
    for (std::size_t i = 1; i < times.size(); ++i) {
      const Duration pause = times[i] - times[i - 1];
      if (pause <= kPauseMax) continue;
      recorded.notes.push_back("nothing was recorded for " + seconds(pause) + " after " +
                               seconds(times[i - 1] - times.front()) +
                               ", or the clock leapt; that pause is played as " +
                               seconds(kPauseLeft));
      total_ += pause - kPauseLeft;
      cuts_.emplace(times[i], total_);
    }
  }
  [[nodiscard]] Duration mended(Duration time) const {
    const auto after = cuts_.upper_bound(time);
    return after == cuts_.begin() ? time : time - std::prev(after)->second;
  }

 private:
  Duration total_{0};
  std::map<Duration, Duration> cuts_{};
};

}  // namespace

Duration time_of(std::uint64_t log_time_ns, std::uint64_t publish_time_ns,
                 std::uint64_t begin_ns) noexcept {
  const bool is_plausible =
      publish_time_ns <= log_time_ns && log_time_ns - publish_time_ns <= kDelayMaxNs;
  const std::uint64_t time_ns = is_plausible ? publish_time_ns : log_time_ns;
  // Small enough that adding two of them can't overflow.
  constexpr std::uint64_t kMost = std::uint64_t{1} << 62;
  const bool is_before = time_ns < begin_ns;
  const std::uint64_t distance_ns = is_before ? begin_ns - time_ns : time_ns - begin_ns;
  const auto distance = static_cast<Duration::rep>(std::min(distance_ns, kMost));
  return Duration{is_before ? -distance : distance};
}

void mend_times(Recorded& recorded) {
  for (RecordedDevice& device : recorded.devices) {
    Rising rising(device.name);
    for (Duration& time : device.times)
      time = rising.next(time);
    rising.tell(recorded.notes);
  }
  std::map<std::size_t, Rising> rising;
  for (RecordedEvent& event : recorded.events) {
    auto& track =
        rising.try_emplace(event.source, recorded.sources[event.source].topic).first->second;
    event.at = track.next(event.at);
  }
  for (const auto& [source, track] : rising) {
    // The loop above has reported on devices' samples.
    if (recorded.sources[source].device.empty()) track.tell(recorded.notes);
  }
  const std::vector<Duration> times = all_times(recorded);
  if (times.empty()) return;
  const Duration begin = times.front();
  const Cuts cuts(recorded, times);
  const auto since_begin = [&](Duration time) { return cuts.mended(time) - begin; };
  for (RecordedDevice& device : recorded.devices)
    std::ranges::transform(device.times, device.times.begin(), since_begin);
  for (RecordedEvent& event : recorded.events)
    event.at = since_begin(event.at);
  std::ranges::stable_sort(recorded.events, {}, &RecordedEvent::at);
  recorded.length = since_begin(times.back());
}

}  // namespace rtpm::replay
