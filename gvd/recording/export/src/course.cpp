#include "course.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>
#include <string_view>
#include <utility>

#include "left_out.hpp"
#include "rtpm/base/nesting.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/capture/channels.hpp"
#include "rtpm/program/text.hpp"

namespace rtpm::exports {
namespace {

constexpr std::string_view kTrialSchema = "rtpm.Trial";
constexpr std::array<std::string_view, 7> kFields{"phase", "number", "condition",  "response",
                                                  "seed",  "note",   "duration_ns"};
/// Trials that have begun and not ended; more replace the first ones.
constexpr std::size_t kOpenCountMax = 65'536;
constexpr std::size_t kIntervalCountMax = std::size_t{1} << 20;
/// Labels and conditions that are kept for a suggestion.
constexpr std::size_t kSuggestedCountMax = 1000;
/// A sender's clock that is off by more has been set meanwhile.
constexpr std::uint64_t kClockErrorMaxNs = 60'000'000'000;
/// The time before and after a part that is read, too.
constexpr std::uint64_t kLeadNs = 5'000'000'000;

std::uint64_t number_in(const std::string& text) {
  std::uint64_t number = 0;
  std::from_chars(text.data(), text.data() + text.size(), number);
  return number;
}

std::uint64_t plus_seconds(std::uint64_t ns, double s) {
  const double sum = static_cast<double>(s) * 1e9;
  if (sum <= -static_cast<double>(ns)) return 0;
  if (sum >= 9e18) return UINT64_MAX;
  return sum < 0 ? ns - static_cast<std::uint64_t>(std::llround(-sum))
                 : ns + static_cast<std::uint64_t>(std::llround(sum));
}

/// Sorts, and joins those that overlap.
std::vector<Interval> merged(std::vector<Interval> intervals) {
  std::ranges::sort(intervals, {}, &Interval::from_ns);
  std::vector<Interval> result;
  for (const Interval& each : intervals) {
    if (!result.empty() && each.from_ns <= result.back().to_ns) {
      result.back().to_ns = std::max(result.back().to_ns, each.to_ns);
    } else {
      result.push_back(each);
    }
  }
  return result;
}

/// The times that are in `a` and in `b`, both sorted.
std::vector<Interval> common(const std::vector<Interval>& a, const std::vector<Interval>& b) {
  std::vector<Interval> result;
  for (auto i = a.begin(), j = b.begin(); i != a.end() && j != b.end();) {
    const Interval both{std::max(i->from_ns, j->from_ns), std::min(i->to_ns, j->to_ns)};
    if (both.from_ns < both.to_ns) result.push_back(both);
    (i->to_ns < j->to_ns ? i : j)++;
  }
  return result;
}

/// Finds the marks and trials that a part names.
class Search {
 public:
  explicit Search(const Part& part) : part_(part) {}

  void add(CourseEvent event) {
    if (event.kind == CourseEvent::Kind::kMark) {
      mark(event);
    } else if (auto ended = pairs_.add(std::move(event))) {
      trial(*ended);
    }
  }

  [[nodiscard]] expected<std::vector<Interval>, SetupError> result() {
    for (const TrialPairs::Trial& each : pairs_.rest())
      trial(each);
    const std::string what = "this part of the recording can't be exported";
    std::vector<Interval> all{{}};
    if (part_.between) {
      const auto& [first, second] = *part_.between;
      for (const auto& [label, at] : {std::pair{&first, &first_}, std::pair{&second, &second_}}) {
        if (*at) continue;
        const bool is_late = label == &second && labels_.contains(second) && first_;
        return setup_error(
            what, is_late ? "no mark '" + printable(second) + "' follows '" + printable(first) + "'"
                          : "there is no mark '" + printable(*label) + "'" +
                                program::suggestion(*label, {labels_.begin(), labels_.end()}));
      }
      all = common(all, {{*first_, *second_ + 1}});
    }
    if (part_.trial) {
      if (by_number_.empty()) {
        return setup_error(what, "there is no trial " + std::to_string(*part_.trial),
                           trial_max_ == 0 ? "the recording has no trials"
                                           : "its trials are " + std::to_string(trial_min_) +
                                                 " to " + std::to_string(trial_max_));
      }
      all = common(all, merged(std::move(by_number_)));
    }
    if (part_.condition) {
      if (by_condition_.empty()) {
        return setup_error(
            what,
            "there is no trial of the condition '" + printable(*part_.condition) + "'" +
                program::suggestion(*part_.condition, {conditions_.begin(), conditions_.end()}));
      }
      all = common(all, merged(std::move(by_condition_)));
    }
    if (is_too_many_) {
      return setup_error(what, "it has more than " + std::to_string(kIntervalCountMax) + " trials");
    }
    return all;
  }

 private:
  void mark(const CourseEvent& event) {
    if (!part_.between) return;
    if (labels_.size() < kSuggestedCountMax) labels_.insert(printable(event.note));
    if (!first_ && event.note == part_.between->first) {
      first_ = event.time_ns;
    } else if (first_ && !second_ && event.note == part_.between->second) {
      second_ = event.time_ns;
    }
  }

  void trial(const TrialPairs::Trial& trial) {
    const CourseEvent& event = trial.event;
    const Interval interval{trial.begin_ns, trial.end_ns ? *trial.end_ns + 1 : UINT64_MAX};
    trial_min_ = std::min(trial_min_, event.number);
    trial_max_ = std::max(trial_max_, event.number);
    if (conditions_.size() < kSuggestedCountMax) conditions_.insert(printable(event.condition));
    if (part_.trial && event.number == *part_.trial) put(by_number_, interval);
    if (part_.condition && event.condition == *part_.condition) put(by_condition_, interval);
  }

  void put(std::vector<Interval>& list, const Interval& interval) {
    if (list.size() >= kIntervalCountMax) {
      is_too_many_ = true;
    } else {
      list.push_back(interval);
    }
  }

  const Part& part_;
  TrialPairs pairs_{};
  std::optional<std::uint64_t> first_{};
  std::optional<std::uint64_t> second_{};
  std::vector<Interval> by_number_{};
  std::vector<Interval> by_condition_{};
  std::set<std::string> labels_{};
  std::set<std::string> conditions_{};
  std::uint32_t trial_min_ = UINT32_MAX;
  std::uint32_t trial_max_ = 0;
  bool is_too_many_ = false;
};

/// Calls `take` for each event and note, in order of time.
template <class Take>
expected<void, SetupError> read_course(recording::FileReader& reader, Course& course,
                                       const recording::Progress& progress, Take take) {
  auto note = course.notes().begin();
  const auto take_notes = [&](std::uint64_t until_ns) {
    for (; note != course.notes().end() && note->time_ns < until_ns; ++note)
      take(*note);
  };
  if (!course.channel_ids().empty()) {
    const auto take_message = [&](const recording::Message& message) {
      take_notes(message.log_time_ns);
      if (auto event = course.read(message)) take(std::move(*event));
      return true;
    };
    auto read = reader.read({.channel_ids = course.channel_ids()}, take_message, progress);
    if (!read) return read;
  }
  take_notes(UINT64_MAX);
  return {};
}

}  // namespace

Course::Course(const recording::FileReader& reader, std::vector<recording::Note> notes) {
  std::ranges::stable_sort(notes, {}, &recording::Note::time_ns);
  for (recording::Note& note : notes)
    notes_.push_back({.time_ns = note.time_ns, .note = std::move(note.text)});
  for (const auto& [number, channel] : reader.channels()) {
    if (channel.topic == capture::kAnnotationTopic && channel.message_encoding == "json") {
      channels_.push_back(number);
      continue;
    }
    const auto schema = reader.schemas().find(channel.schema_id);
    if (schema == reader.schemas().end() || schema->second.name != kTrialSchema) continue;
    auto rows = Rows::make(schema->second);
    if (!rows) continue;
    Trials trials{.rows = std::move(*rows)};
    bool is_known = true;
    for (std::size_t i = 0; i < kFieldCount; ++i) {
      const auto& columns = trials.rows->columns();
      const auto found = std::ranges::find(columns, kFields[i], &Column::name);
      trials.at[i] = static_cast<std::size_t>(found - columns.begin());
      is_known = is_known && found != columns.end();
    }
    if (!is_known) continue;
    channels_.push_back(number);
    trials_.emplace(number, std::move(trials));
  }
}

bool Course::has(std::uint16_t channel) const noexcept {
  return std::ranges::find(channels_, channel) != channels_.end();
}

std::optional<CourseEvent> Course::read(const recording::Message& message) {
  CourseEvent event{.time_ns = time_of(message), .channel = message.channel_id};
  const auto found = trials_.find(message.channel_id);
  if (found == trials_.end()) {
    const auto json = parse_bounded_json<nlohmann::json>(
        std::string_view(reinterpret_cast<const char*>(message.data.data()), message.data.size()));
    const auto text = json.is_object() ? json.find("text") : json.end();
    if (!json.is_object() || text == json.end() || !text->is_string()) return std::nullopt;
    event.note = text->get<std::string>();
    return event;
  }
  Trials& trials = found->second;
  if (!trials.rows->read(message.data, cells_)) return std::nullopt;
  const auto cell = [&](Field field) -> std::string& { return cells_[trials.at[field]]; };
  event.kind = cell(kPhase) == "Begin" ? CourseEvent::Kind::kBegin
               : cell(kPhase) == "End" ? CourseEvent::Kind::kEnd
                                       : CourseEvent::Kind::kMark;
  event.number = static_cast<std::uint32_t>(number_in(cell(kNumber)));
  event.condition = std::move(cell(kCondition));
  event.response = std::move(cell(kResponse));
  event.seed = std::move(cell(kSeed));
  event.note = std::move(cell(kNote));
  if (!cell(kDuration).empty()) event.duration_ns = number_in(cell(kDuration));
  return event;
}

std::optional<TrialPairs::Trial> TrialPairs::add(CourseEvent event) {
  if (event.kind == CourseEvent::Kind::kMark) return std::nullopt;
  const std::pair key{event.channel, event.number};
  if (event.kind == CourseEvent::Kind::kBegin) {
    if (open_.size() >= kOpenCountMax) open_.erase(open_.begin());
    open_.insert_or_assign(key, std::move(event));
    return std::nullopt;
  }
  const std::uint64_t end_ns = event.time_ns;
  std::uint64_t begin_ns = end_ns;
  if (const auto begin = open_.find(key); begin != open_.end()) {
    begin_ns = std::min(begin->second.time_ns, end_ns);
    open_.erase(begin);
  } else if (event.duration_ns) {
    begin_ns = end_ns - std::min(*event.duration_ns, end_ns);
  }
  return Trial{std::move(event), begin_ns, end_ns};
}

std::vector<TrialPairs::Trial> TrialPairs::rest() {
  std::vector<Trial> trials;
  for (auto& [key, begin] : open_) {
    const std::uint64_t begin_ns = begin.time_ns;
    trials.push_back({std::move(begin), begin_ns, std::nullopt});
  }
  open_.clear();
  std::ranges::sort(trials, {}, &Trial::begin_ns);
  return trials;
}

expected<std::vector<Interval>, SetupError> intervals_of(recording::FileReader& reader,
                                                         Course& course, const Part& part,
                                                         const recording::Progress& progress) {
  const std::string what = "this part of the recording can't be exported";
  const recording::Statistics& statistics = reader.statistics();
  Interval whole{};
  if (part.from_s) whole.from_ns = plus_seconds(statistics.begin_ns, *part.from_s);
  if (part.to_s) whole.to_ns = plus_seconds(statistics.begin_ns, *part.to_s);
  if (whole.from_ns >= whole.to_ns || whole.from_ns > statistics.end_ns) {
    const std::uint64_t length_ns = statistics.end_ns - statistics.begin_ns;
    return setup_error(what, "it is empty",
                       "the recording has " +
                           program::formatted("%.3f", static_cast<double>(length_ns) * 1e-9) +
                           " seconds, from 0");
  }
  if (!part.between && !part.trial && !part.condition) return std::vector<Interval>{whole};
  Search search(part);
  auto read = read_course(reader, course, progress,
                          [&](CourseEvent event) { search.add(std::move(event)); });
  if (!read) return unexpected{read.error()};
  auto found = search.result();
  if (!found) return found;
  auto intervals = common({whole}, *found);
  if (intervals.empty()) return setup_error(what, "its conditions have nothing in common");
  return intervals;
}

expected<TableChoices, SetupError> choices_of(recording::FileReader& reader,
                                              std::vector<recording::Note> notes,
                                              const recording::Progress& progress) {
  TableChoices choices;
  for (const auto& [number, channel] : reader.channels()) {
    if (!is_view(channel) && choices.topics.size() < kSuggestedCountMax)
      choices.topics.push_back(channel.topic);
  }
  std::ranges::sort(choices.topics);
  Course course(reader, std::move(notes));
  const auto add = [](auto& known, auto& list, const auto& value) {
    if (list.size() < kSuggestedCountMax && known.insert(value).second) list.push_back(value);
  };
  std::set<std::uint32_t> trials;
  std::set<std::string> conditions;
  std::set<std::string> marks;
  const auto read = read_course(reader, course, progress, [&](const CourseEvent& event) {
    if (event.kind == CourseEvent::Kind::kMark) {
      add(marks, choices.marks, event.note);
      return;
    }
    add(trials, choices.trials, event.number);
    if (!event.condition.empty()) add(conditions, choices.conditions, event.condition);
  });
  if (!read) return unexpected{read.error()};
  return choices;
}

recording::Query query_of(const std::vector<Interval>& intervals) {
  const std::uint64_t from_ns = intervals.front().from_ns;
  const std::uint64_t to_ns = intervals.back().to_ns;
  return {.from_ns = from_ns - std::min(from_ns, kLeadNs),
          .to_ns = to_ns > UINT64_MAX - kLeadNs ? UINT64_MAX : to_ns + kLeadNs};
}

bool is_inside(const std::vector<Interval>& intervals, std::uint64_t time_ns) noexcept {
  const auto after = std::ranges::upper_bound(intervals, time_ns, {}, &Interval::from_ns);
  return after != intervals.begin() && time_ns < std::prev(after)->to_ns;
}

std::uint64_t time_of(const recording::Message& message) noexcept {
  const std::uint64_t a = message.publish_time_ns;
  const std::uint64_t b = message.log_time_ns;
  return (a < b ? b - a : a - b) > kClockErrorMaxNs ? b : a;
}

}  // namespace rtpm::exports
