#pragma once

#include <span>
#include <string>
#include <vector>

#include "rtpm/driver/geometry.hpp"
#include "touch_event.hpp"

/// A scene and its touches, as lines in two flat panels. Uses no clock and no output.
namespace rtpm::scene {

/// The kind of a line.
enum class Ink : std::uint8_t {
  kSolid = 0,   ///< The scene.
  kDevice = 1,  ///< The path of the device.
  kProxy = 2,   ///< The path of the proxy.
  kSpring = 3,  ///< The line from the device to the proxy.
  kForce = 4,   ///< The force on the device, drawn from the proxy.
};
inline constexpr std::uint8_t kInkCount = 5;

/// A position in a panel.
struct Point {
  double right_mm = 0;
  double up_mm = 0;
};

struct Line {
  Ink ink = Ink::kSolid;
  std::vector<Point> points{};
};

/// One view: a window of kPanelWidthMm by kPanelHeightMm. Lines may leave it.
struct Panel {
  std::string title{};
  std::string right_axis{};
  std::string up_axis{};
  Point low{};                 ///< The window's lower left corner.
  std::vector<Point> solid{};  ///< A closed polygon to fill; may be empty.
  std::vector<Line> lines{};   ///< Later lines are drawn over earlier ones.
};
inline constexpr double kPanelWidthMm = 90;
inline constexpr double kPanelHeightMm = 60;
/// The drawn length of a force.
inline constexpr double kMmPerNewton = 3;

/// The content of a drawing.
struct Story {
  std::span<const driver::Vector3> device_m{};
  std::span<const TouchReport> touches{};
  /// Draws the force of every `force_stride`-th touch, counted from the newest; if 0, none.
  std::size_t force_stride = 0;
};

/// The view in section: x to the right, z up.
/// @realtime set-up only
[[nodiscard]] Panel section_panel(const Story& story);
/// The operator's view: x to the right, y up.
/// @realtime set-up only
[[nodiscard]] Panel front_panel(const Story& story);

}  // namespace rtpm::scene
