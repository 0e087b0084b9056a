#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "course.hpp"

namespace rtpm::exports {

/// One table of several sources on one clock: each value is held until the next one of its source.
/// A row has the time, the trial, the marks since the row before, and all values.
/// @ownership refers to the intervals
class Sheet {
 public:
  struct Config {
    std::uint64_t begin_ns = 0;  ///< Second 0.
    std::uint64_t end_ns = 0;    ///< The recording's last message.
    double rate_hz = 0;          ///< 0: a row for each time at which a value came.
    bool has_course = false;     ///< Whether there are columns for trials and marks.
  };
  /// @param file  lines are appended to it
  Sheet(Config config, const std::vector<Interval>& intervals, std::filesystem::path file);

  /// @param header  the names of its columns, as cells
  /// @return the source's index
  std::size_t add(std::vector<std::string> header);
  [[nodiscard]] expected<void, SetupError> write_header();

  /// Takes a source's cells, or an event of the course, in order of time; a late one counts as of
  /// the last time.
  [[nodiscard]] expected<void, SetupError> set(std::uint64_t time_ns, std::size_t source,
                                               std::string cells);
  [[nodiscard]] expected<void, SetupError> set(std::uint64_t time_ns, const CourseEvent& event);
  /// Writes the last rows.
  [[nodiscard]] expected<void, SetupError> finish();

  [[nodiscard]] std::uint64_t row_count() const noexcept { return row_count_; }
  [[nodiscard]] std::uint64_t late_count() const noexcept { return late_count_; }

 private:
  [[nodiscard]] expected<void, SetupError> advance(std::uint64_t time_ns);
  /// Writes the rows at the rate before `time_ns`.
  [[nodiscard]] expected<void, SetupError> write_until(std::uint64_t time_ns);
  [[nodiscard]] expected<void, SetupError> write_row(std::uint64_t time_ns);
  [[nodiscard]] std::uint64_t grid_ns() const noexcept;

  Config config_;
  const std::vector<Interval>& intervals_;
  std::filesystem::path file_;
  std::vector<std::vector<std::string>> headers_{};
  std::vector<std::string> held_{};  ///< The cells of each source.
  std::string trial_{};              ///< Its number; empty outside of trials.
  std::string condition_{};
  std::string marks_{};
  std::uint64_t now_ns_ = 0;
  bool is_inside_ = false;    ///< Whether `now_ns_` is in an interval.
  std::size_t interval_ = 0;  ///< The one of the next row at the rate.
  std::uint64_t step_ = 0;    ///< Counts the rows of that interval.
  std::string lines_{};
  std::uint64_t row_count_ = 0;
  std::uint64_t late_count_ = 0;
};

}  // namespace rtpm::exports
