#include "rtpm/device_sim/trajectory.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <fstream>
#include <optional>
#include <utility>

namespace rtpm::device_sim {
namespace {

constexpr std::string_view kHeader = "t_s,x_m,y_m,z_m";
constexpr std::array<std::string_view, 4> kColumns{"t_s", "x_m", "y_m", "z_m"};
/// The longest part of a text that is shown; the limit keeps error texts short.
constexpr std::size_t kShownTextMax = 40;

std::string_view trimmed(std::string_view text) {
  constexpr std::string_view kSpace = " \t\r";
  const std::size_t begin = text.find_first_not_of(kSpace);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(kSpace) - begin + 1);
}

std::string quoted(std::string_view text) {
  std::string shown = "\"" + std::string(text.substr(0, kShownTextMax));
  return shown + (text.size() > kShownTextMax ? "…\"" : "\"");
}

std::string shown(double number) {
  std::array<char, 32> text{};
  const auto result = std::to_chars(text.data(), text.data() + text.size(), number);
  return {text.data(), result.ptr};
}

std::string without_spaces(std::string_view text) {
  std::string bare;
  for (const char character : text) {
    if (character != ' ' && character != '\t') bare += character;
  }
  return bare;
}

/// The four numbers in the line, or its fault.
expected<std::array<double, 4>, SetupError> numbers_of(std::string_view line) {
  std::array<double, 4> numbers{};
  for (std::size_t column = 0; column < numbers.size(); ++column) {
    const std::size_t comma = line.find(',');
    const bool is_last = column + 1 == numbers.size();
    if (is_last != (comma == std::string_view::npos)) {
      return setup_error("expected four numbers separated by commas, " + std::string(kHeader) +
                         (is_last ? ", and found more" : ", and found fewer"));
    }
    std::string_view field = trimmed(line.substr(0, comma));
    const std::string_view whole = field;
    if (field.starts_with('+')) field.remove_prefix(1);
    const auto [end, error] =
        std::from_chars(field.data(), field.data() + field.size(), numbers[column]);
    if (error == std::errc::result_out_of_range) {
      return setup_error(std::string(kColumns[column]) + " is " + quoted(whole) +
                         ", beyond the range of numbers");
    }
    if (error != std::errc{} || end != field.data() + field.size()) {
      return setup_error(std::string(kColumns[column]) + " is " + quoted(whole) +
                         ", which is not a number (a decimal point, no unit)");
    }
    if (!std::isfinite(numbers[column])) {
      return unexpected{std::string(kColumns[column]) + " is " + quoted(whole) +
                        "; it must be finite"};
    }
    line.remove_prefix(is_last ? line.size() : comma + 1);
  }
  return numbers;
}

/// The fault of a position that the arm can't reach; nullopt if it can reach it.
std::optional<std::string> outside(const Eigen::Vector3d& position_m,
                                   const driver::Workspace& workspace) {
  const std::array<double, 3> low{workspace.low_m.x, workspace.low_m.y, workspace.low_m.z};
  const std::array<double, 3> high{workspace.high_m.x, workspace.high_m.y, workspace.high_m.z};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double at = position_m[static_cast<Eigen::Index>(axis)];
    if (at >= low[axis] && at <= high[axis]) continue;
    return std::string(kColumns[axis + 1]) + " is " + shown(at) +
           ", outside the arm's workspace of " + shown(low[axis]) + " to " + shown(high[axis]) +
           " m; positions are in metres";
  }
  return std::nullopt;
}

}  // namespace

expected<Trajectory, SetupError> Trajectory::load(const std::filesystem::path& path,
                                                  const driver::Workspace& workspace) {
  std::error_code error;
  if (std::filesystem::is_directory(path, error)) {
    return setup_error(path.string() + " is a folder", "",
                       "give a CSV file of " + std::string(kHeader));
  }
  std::ifstream file(path);
  if (!file) {
    return setup_error(path.string() + " can't be read", "",
                       "check that the file is there and readable");
  }
  return parse(file, path.string(), workspace);
}

expected<Trajectory, SetupError> Trajectory::parse(std::istream& text, std::string_view name,
                                                   const driver::Workspace& workspace) {
  std::vector<Point> points;
  std::string line;
  std::size_t line_number = 0;
  bool may_be_header = true;
  const auto wrong = [&](const std::string& why) {
    return setup_error(std::string(name) + ":" + std::to_string(line_number), why);
  };
  while (std::getline(text, line)) {
    ++line_number;
    std::string_view content = line;
    if (line_number == 1 && content.starts_with("\xef\xbb\xbf")) content.remove_prefix(3);
    content = trimmed(content);
    if (content.empty() || content.starts_with('#')) continue;
    if (std::exchange(may_be_header, false) && without_spaces(content) == kHeader) continue;
    const auto numbers = numbers_of(content);
    if (!numbers) return wrong(numbers.error().what);
    const Point point{(*numbers)[0], {(*numbers)[1], (*numbers)[2], (*numbers)[3]}};
    if (!points.empty() && point.time_s <= points.back().time_s) {
      return wrong("t_s is " + shown(point.time_s) + " after " + shown(points.back().time_s) +
                   "; times must grow from line to line");
    }
    if (const auto problem = outside(point.position_m, workspace)) return wrong(*problem);
    if (points.size() == kPointCountMax) {
      return wrong("more than " + std::to_string(kPointCountMax) + " points; use a shorter file");
    }
    points.push_back(point);
  }
  if (text.bad()) return wrong("reading failed in the middle of the file");
  if (points.empty()) {
    line_number = std::max<std::size_t>(line_number, 1);
    return wrong("no points; give lines of " + std::string(kHeader));
  }
  return Trajectory{std::move(points)};
}

Motion Trajectory::at(double time_s) const noexcept {
  const double length_s = duration_s();
  if (length_s <= 0 || !std::isfinite(time_s)) {
    return {points_.front().position_m, Eigen::Vector3d::Zero()};
  }
  double phase_s = std::fmod(std::max(time_s, 0.0), 2 * length_s);
  double direction = 1;
  if (phase_s > length_s) {
    phase_s = 2 * length_s - phase_s;
    direction = -1;
  }
  const double wanted_s = points_.front().time_s + phase_s;
  // The first point after the given time ends the segment; the last segment includes its end.
  auto end = std::upper_bound(points_.begin() + 1, points_.end() - 1, wanted_s,
                              [](double time, const Point& point) { return time < point.time_s; });
  const Point& from = *(end - 1);
  const Point& to = *end;
  const double span_s = to.time_s - from.time_s;
  const double share = std::clamp((wanted_s - from.time_s) / span_s, 0.0, 1.0);
  const Eigen::Vector3d way_m = to.position_m - from.position_m;
  return {from.position_m + share * way_m, direction / span_s * way_m};
}

}  // namespace rtpm::device_sim
