#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <istream>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/expected.hpp"
#include "rtpm/driver/descriptor.hpp"
#include "rtpm/driver/driver.hpp"

namespace rtpm::device_sim {

/// Where something is and how fast it moves, at one moment.
struct Motion {
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d velocity_m_per_s = Eigen::Vector3d::Zero();
};

/// A recorded path: positions over time, straight lines between them.
///
/// As a file it is text, one point per line, "t_s,x_m,y_m,z_m": seconds and metres, at any rate,
/// the times growing from line to line. Spaces, empty lines and lines that begin with # are
/// skipped. The first line may be the header "t_s,x_m,y_m,z_m"; anything else that is not four
/// numbers is an error. At most kPointCountMax points. Ownership: a value.   Threads: reading is
/// safe from several.
class Trajectory {
 public:
  static constexpr std::size_t kPointCountMax = 10'000'000;

  /// Reads the file at `path`; every point must lie within `workspace`.   Set-up only.
  /// Errors: a file that can't be read, is empty, or has a line that is not as said above: the text
  /// begins with "file:line: " and says what is wrong there.
  [[nodiscard]] static expected<Trajectory, driver::DriverError> load(
      const std::filesystem::path& path, const driver::Workspace& workspace);
  /// Likewise from `text`; `name` stands for the file's in errors.   Set-up only.
  [[nodiscard]] static expected<Trajectory, driver::DriverError> parse(
      std::istream& text, std::string_view name, const driver::Workspace& workspace);

  /// From the first point's time to the last's, in seconds; 0 for a single point.
  [[nodiscard]] double duration_s() const noexcept {
    return points_.back().time_s - points_.front().time_s;
  }
  [[nodiscard]] std::size_t point_count() const noexcept { return points_.size(); }

  /// The motion `time_s` seconds after the first point. The recording plays there and back for
  /// ever: after its end it goes backwards, at its begin forwards again, so that it never jumps.
  /// RT: alloc-free; a search in the points, O(log n).
  [[nodiscard]] Motion at(double time_s) const noexcept;

 private:
  struct Point {
    double time_s = 0;
    Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
  };
  explicit Trajectory(std::vector<Point> points) noexcept : points_(std::move(points)) {}

  std::vector<Point> points_;
};

}  // namespace rtpm::device_sim
