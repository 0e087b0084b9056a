#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "rows.hpp"
#include "rtpm/exports/export.hpp"

namespace rtpm::exports {

/// A trial's begin or end, or a mark: of an event rtpm.Trial, an annotation, or a note.
struct CourseEvent {
  enum class Kind : std::uint8_t { kMark, kBegin, kEnd };
  Kind kind = Kind::kMark;
  std::uint64_t time_ns = 0;
  std::uint16_t channel = 0;
  std::uint32_t number = 0;  ///< 0 outside of trials.
  std::string condition{};
  std::string response{};
  std::string seed{};  ///< Empty if there is none.
  std::string note{};  ///< A mark's label.
  std::optional<std::uint64_t> duration_ns{};
};

/// The channels with the course of an experiment, and the notes about it.
class Course {
 public:
  /// @param notes  those beside the recording
  explicit Course(const recording::FileReader& reader, std::vector<recording::Note> notes = {});
  [[nodiscard]] const std::vector<std::uint16_t>& channel_ids() const noexcept { return channels_; }
  [[nodiscard]] bool has(std::uint16_t channel) const noexcept;
  [[nodiscard]] bool is_empty() const noexcept { return channels_.empty() && notes_.empty(); }
  /// The message of such a channel; nullopt if it is broken.
  [[nodiscard]] std::optional<CourseEvent> read(const recording::Message& message);
  /// The notes as marks, in order of time.
  [[nodiscard]] const std::vector<CourseEvent>& notes() const noexcept { return notes_; }

 private:
  /// The columns of rtpm.Trial.
  enum Field : std::uint8_t {
    kPhase,
    kNumber,
    kCondition,
    kResponse,
    kSeed,
    kNote,
    kDuration,
    kFieldCount
  };
  struct Trials {
    std::unique_ptr<Rows> rows{};
    std::array<std::size_t, kFieldCount> at{};  ///< The columns' indices.
  };

  std::vector<std::uint16_t> channels_{};
  std::vector<CourseEvent> notes_{};
  std::map<std::uint16_t, Trials> trials_{};  ///< Other channels have annotations.
  std::vector<std::string> cells_{};
};

/// Pairs begins and ends, in any order of trials.
class TrialPairs {
 public:
  struct Trial {
    CourseEvent event{};  ///< The end, or the begin if there is no end.
    std::uint64_t begin_ns = 0;
    std::optional<std::uint64_t> end_ns{};  ///< nullopt if it was not ended.
  };
  /// @return the trial that ends
  [[nodiscard]] std::optional<Trial> add(CourseEvent event);
  /// The trials that have not ended.
  [[nodiscard]] std::vector<Trial> rest();

 private:
  std::map<std::pair<std::uint16_t, std::uint32_t>, CourseEvent> open_{};
};

/// From the first to before the last nanosecond.
struct Interval {
  std::uint64_t from_ns = 0;
  std::uint64_t to_ns = UINT64_MAX;
};

/// The intervals of a part, sorted and apart from each other; at least one.
/// @errors   a mark or trial that the recording does not have; an empty part
[[nodiscard]] expected<std::vector<Interval>, SetupError> intervals_of(
    recording::FileReader& reader, Course& course, const Part& part,
    const recording::Progress& progress);

/// Selects the messages of the intervals on all channels, and those of 5 s before and after: they
/// may come late, and values hold.
[[nodiscard]] recording::Query query_of(const std::vector<Interval>& intervals);

/// Whether `time_ns` is inside one of the intervals.
[[nodiscard]] bool is_inside(const std::vector<Interval>& intervals,
                             std::uint64_t time_ns) noexcept;

/// The time of a message: its origin, or the log time if these are not from the same clock.
[[nodiscard]] std::uint64_t time_of(const recording::Message& message) noexcept;

}  // namespace rtpm::exports
