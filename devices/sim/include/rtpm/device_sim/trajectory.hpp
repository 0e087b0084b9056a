#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <istream>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/driver/descriptor.hpp"
#include "rtpm/driver/driver.hpp"

namespace rtpm::device_sim {

/// Position and velocity at one time.
struct Motion {
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d velocity_m_per_s = Eigen::Vector3d::Zero();
};

/// A recorded path: positions over time, connected by straight lines.
///
/// Its file is text with one point per line, "t_s,x_m,y_m,z_m": seconds and metres, at any rate,
/// with increasing times. Spaces, empty lines and lines that start with # are skipped. The first
/// line may be the header "t_s,x_m,y_m,z_m"; any other line that is not four numbers is an error.
/// At most kPointCountMax points.
/// @ownership a value
/// @threads  any number of threads may read it
class Trajectory {
 public:
  static constexpr std::size_t kPointCountMax = 10'000'000;

  /// Reads the file at `path`; every point must be within `workspace`.
  /// @realtime set-up only
  /// @errors   an unreadable or empty file, a malformed line: the text starts with "file:line: "
  [[nodiscard]] static expected<Trajectory, SetupError> load(const std::filesystem::path& path,
                                                             const driver::Workspace& workspace);
  /// Parses `text` like load() parses a file; errors name it `name`. Set-up only.
  [[nodiscard]] static expected<Trajectory, SetupError> parse(std::istream& text,
                                                              std::string_view name,
                                                              const driver::Workspace& workspace);

  /// The time from the first to the last point, in seconds; 0 for a single point.
  [[nodiscard]] double duration_s() const noexcept {
    return points_.back().time_s - points_.front().time_s;
  }
  [[nodiscard]] std::size_t point_count() const noexcept { return points_.size(); }

  /// The motion `time_s` seconds after the first point. The recording plays forwards and backwards
  /// alternately, so that it never jumps.
  /// @realtime alloc-free; a binary search
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
