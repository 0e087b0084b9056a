#include "drawing.hpp"

#include <cmath>
#include <numbers>
#include <utility>

#include "rtpm/driver/vector.hpp"

namespace rtpm::scene {
namespace {

using driver::Vector3;

constexpr double kMmPerMetre = 1e3;
/// The hand and the forces need space above the face.
constexpr double kAboveFaceMm = 24;
constexpr int kCirclePointCount = 90;
constexpr double kSurfaceStepMm = 0.5;

Point in_section(const Vector3& at_m) noexcept {
  return {at_m.x * kMmPerMetre, at_m.z * kMmPerMetre};
}
Point in_front(const Vector3& at_m) noexcept {
  return {at_m.x * kMmPerMetre, at_m.y * kMmPerMetre};
}

std::vector<Point> circle(const Point& centre) {
  constexpr double kRadiusMm = Scene::kRadiusMetre * kMmPerMetre;
  std::vector<Point> points;
  for (int i = 0; i <= kCirclePointCount; ++i) {
    const double angle = 2 * std::numbers::pi * i / kCirclePointCount;
    points.push_back({centre.right_mm + kRadiusMm * std::cos(angle),
                      centre.up_mm + kRadiusMm * std::sin(angle)});
  }
  return points;
}

/// The surface of plane or texture, from the window's left edge to its right edge.
std::vector<Point> surface(const Scene& scene, const Panel& panel) {
  std::vector<Point> points;
  for (int i = 0; i <= static_cast<int>(kPanelWidthMm / kSurfaceStepMm); ++i) {
    const double right_mm = panel.low.right_mm + kSurfaceStepMm * i;
    points.push_back({right_mm, scene.height_m(right_mm / kMmPerMetre) * kMmPerMetre});
  }
  return points;
}

void add_section(Panel& panel, const Scene& scene) {
  if (scene.shape == Shape::kSphere) {
    panel.solid = circle(in_section(scene.centre_m()));
    panel.lines.push_back({Ink::kSolid, panel.solid});
    return;
  }
  panel.lines.push_back({Ink::kSolid, surface(scene, panel)});
  panel.solid = panel.lines.back().points;
  panel.solid.push_back({panel.low.right_mm + kPanelWidthMm, panel.low.up_mm});
  panel.solid.push_back(panel.low);
}

void add_front(Panel& panel, const Scene& scene) {
  const double top_mm = panel.low.up_mm + kPanelHeightMm;
  const double right_mm = panel.low.right_mm + kPanelWidthMm;
  if (scene.shape == Shape::kSphere) {
    panel.solid = circle(in_front(scene.centre_m()));
    panel.lines.push_back({Ink::kSolid, panel.solid});
    return;
  }
  panel.solid = {
      panel.low, {right_mm, panel.low.up_mm}, {right_mm, top_mm}, {panel.low.right_mm, top_mm}};
  if (scene.shape != Shape::kTexture) return;
  constexpr double kSpacingMm = Scene::kRidgeSpacingMetre * kMmPerMetre;
  const int first = static_cast<int>(std::ceil(panel.low.right_mm / kSpacingMm));
  for (int i = first; i * kSpacingMm <= right_mm; ++i) {
    const double crest_mm = i * kSpacingMm;
    panel.lines.push_back({Ink::kSolid, {{crest_mm, panel.low.up_mm}, {crest_mm, top_mm}}});
  }
}

/// Draws paths and forces; `flat` projects them onto the panel.
template <class Flat>
void add_story(Panel& panel, const Story& story, Flat flat) {
  Line device{Ink::kDevice};
  for (const Vector3& at : story.device_m)
    device.points.push_back(flat(at));
  Line proxy{Ink::kProxy};
  std::vector<Line> forces;
  for (std::size_t i = 0; i < story.touches.size(); ++i) {
    const Touch& touch = story.touches[i].touch;
    proxy.points.push_back(flat(touch.proxy_m));
    const std::size_t age = story.touches.size() - 1 - i;
    if (touch.depth_m <= 0 || story.force_stride == 0 || age % story.force_stride != 0) continue;
    const Point from = flat(touch.proxy_m);
    const Vector3 reach = scaled(touch.force_newton, kMmPerNewton / kMmPerMetre);
    panel.lines.push_back({Ink::kSpring, {flat(touch.device_m), from}});
    forces.push_back({Ink::kForce, {from, flat(sum(touch.proxy_m, reach))}});
  }
  panel.lines.push_back(std::move(device));
  panel.lines.push_back(std::move(proxy));
  panel.lines.insert(panel.lines.end(), forces.begin(), forces.end());
}

}  // namespace

Panel section_panel(const Story& story) {
  const double face_m = story.touches.empty() ? 0 : story.touches.back().scene.face_m;
  Panel panel{.title = "section", .right_axis = "x", .up_axis = "z"};
  panel.low = {-kPanelWidthMm / 2, face_m * kMmPerMetre + kAboveFaceMm - kPanelHeightMm};
  if (!story.touches.empty()) add_section(panel, story.touches.back().scene);
  add_story(panel, story, in_section);
  return panel;
}

Panel front_panel(const Story& story) {
  Panel panel{.title = "front", .right_axis = "x", .up_axis = "y"};
  panel.low = {-kPanelWidthMm / 2, -kPanelHeightMm / 2};
  if (!story.touches.empty()) add_front(panel, story.touches.back().scene);
  add_story(panel, story, in_front);
  return panel;
}

}  // namespace rtpm::scene
