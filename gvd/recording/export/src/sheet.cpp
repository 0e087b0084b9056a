#include "sheet.hpp"

#include <algorithm>
#include <cmath>
#include <string_view>
#include <utility>

#include "csv_text.hpp"
#include "rtpm/base/printable.hpp"

namespace rtpm::exports {
namespace {

constexpr std::size_t kLineByteMax = std::size_t{1} << 16;
/// The marks of one row.
constexpr std::size_t kMarkByteMax = 4096;
constexpr std::string_view kMoreMarks = "; and more";

}  // namespace

Sheet::Sheet(Config config, const std::vector<Interval>& intervals, std::filesystem::path file)
    : config_(config), intervals_(intervals), file_(std::move(file)) {}

std::size_t Sheet::add(std::vector<std::string> header) {
  headers_.push_back(std::move(header));
  held_.emplace_back(std::max<std::size_t>(headers_.back().size(), 1) - 1, ',');
  return headers_.size() - 1;
}

expected<void, SetupError> Sheet::write_header() {
  std::string line = "time [UTC],seconds [s]";
  if (config_.has_course) line += ",trial,condition,marker";
  for (const auto& header : headers_) {
    for (const std::string& name : header) {
      line += ',';
      append_text_cell(line, name);
    }
  }
  return append_to_file(file_, line + "\r\n");
}

expected<void, SetupError> Sheet::set(std::uint64_t time_ns, std::size_t source,
                                      std::string cells) {
  if (auto done = advance(time_ns); !done) return done;
  held_[source] = std::move(cells);
  return {};
}

expected<void, SetupError> Sheet::set(std::uint64_t time_ns, const CourseEvent& event) {
  if (auto done = advance(time_ns); !done) return done;
  if (event.kind == CourseEvent::Kind::kMark) {
    if (!is_inside_) return {};
    const std::string label = printable(event.note, kMarkByteMax);
    if (marks_.size() + label.size() <= kMarkByteMax) {
      marks_ += (marks_.empty() ? "" : "; ") + label;
    } else if (!marks_.ends_with(kMoreMarks)) {
      marks_ += kMoreMarks;
    }
    return {};
  }
  const bool is_begin = event.kind == CourseEvent::Kind::kBegin;
  trial_ = is_begin ? std::to_string(event.number) : "";
  condition_ = is_begin ? printable(event.condition) : "";
  return {};
}

expected<void, SetupError> Sheet::advance(std::uint64_t time_ns) {
  if (time_ns < now_ns_) {
    ++late_count_;
    time_ns = now_ns_;
  }
  if (config_.rate_hz > 0) {
    if (auto done = write_until(time_ns); !done) return done;
  } else if (is_inside_ && time_ns > now_ns_) {
    if (auto done = write_row(now_ns_); !done) return done;
  }
  now_ns_ = time_ns;
  is_inside_ = is_inside(intervals_, now_ns_);
  return {};
}

std::uint64_t Sheet::grid_ns() const noexcept {
  const double after_ns = static_cast<double>(step_) * 1e9 / config_.rate_hz;
  return std::max(intervals_[interval_].from_ns, config_.begin_ns) +
         static_cast<std::uint64_t>(std::llround(after_ns));
}

expected<void, SetupError> Sheet::write_until(std::uint64_t time_ns) {
  while (interval_ < intervals_.size()) {
    const std::uint64_t at = grid_ns();
    if (at >= intervals_[interval_].to_ns || at > config_.end_ns) {
      ++interval_;
      step_ = 0;
      continue;
    }
    if (at >= time_ns) return {};
    if (auto done = write_row(at); !done) return done;
    ++step_;
  }
  return {};
}

expected<void, SetupError> Sheet::write_row(std::uint64_t time_ns) {
  lines_ += time_text(time_ns);
  lines_ += ',';
  lines_ += seconds_text(time_ns, config_.begin_ns);
  if (config_.has_course) {
    lines_ += ',';
    lines_ += trial_;
    lines_ += ',';
    append_text_cell(lines_, condition_);
    lines_ += ',';
    append_text_cell(lines_, marks_);
    marks_.clear();
  }
  for (const std::string& cells : held_) {
    lines_ += ',';
    lines_ += cells;
  }
  lines_ += "\r\n";
  ++row_count_;
  if (lines_.size() < kLineByteMax) return {};
  auto written = append_to_file(file_, lines_);
  lines_.clear();
  return written;
}

expected<void, SetupError> Sheet::finish() {
  if (config_.rate_hz > 0) {
    if (auto done = write_until(UINT64_MAX); !done) return done;
  }
  const bool is_owed = config_.rate_hz > 0 ? !marks_.empty() : is_inside_;
  if (is_owed) {
    if (auto done = write_row(now_ns_); !done) return done;
  }
  auto written = append_to_file(file_, lines_);
  lines_.clear();
  return written;
}

}  // namespace rtpm::exports
