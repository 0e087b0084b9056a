#include "rtpm/models/check.hpp"
#include "rtpm/driver/vector.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <numbers>

namespace rtpm::gvd {
namespace {

constexpr double kExtentMetre = ModelLimits::kExtentMaxMetre;
/// One nanometre: above zero, but large enough that no force overflows.
constexpr double kLengthMinMetre = 1e-9;
constexpr double kSpacingMinRad = 1e-6;
constexpr double kAngleMaxRad = 1e6;
constexpr double kUnitTolerance = 1e-6;

/// Checks the fields of one model and keeps the first error.
class Checker {
 public:
  Checker(std::size_t index, const Model& model, const ModelLimits& limits) noexcept
      : index_(index), kind_(to_string(model)), limits_(limits) {}

  [[nodiscard]] const std::optional<ModelError>& error() const noexcept { return error_; }

  void operator()(const Plane& plane) noexcept {
    position("point_m", plane.point_m);
    direction("normal", plane.normal);
    surface(plane);
  }
  void operator()(const Sphere& sphere) noexcept {
    position("centre_m", sphere.centre_m);
    number("radius_m", sphere.radius_m, kLengthMinMetre, kExtentMetre);
    side(sphere.side);
    surface(sphere);
  }
  void operator()(const Box& box) noexcept {
    position("low_m", box.low_m);
    number("high_m", box.high_m.x, box.low_m.x + kLengthMinMetre, kExtentMetre);
    number("high_m", box.high_m.y, box.low_m.y + kLengthMinMetre, kExtentMetre);
    number("high_m", box.high_m.z, box.low_m.z + kLengthMinMetre, kExtentMetre);
    side(box.side);
    surface(box);
  }
  void operator()(const Spring& spring) noexcept {
    position("anchor_m", spring.anchor_m);
    surface(spring);
    number("force_newton_max", spring.force_newton_max, 0, limits_.force_newton_max);
  }
  void operator()(const AffineField& field) noexcept;
  void operator()(const Friction& friction) noexcept {
    number("force_newton", friction.force_newton, 0, limits_.force_newton_max);
    const double stiffness_min =
        friction.force_newton > 0 ? friction.force_newton / kExtentMetre : 0;
    number("stiffness_newton_per_m", friction.stiffness_newton_per_m, stiffness_min,
           limits_.stiffness_newton_per_m_max);
    damping("viscosity_newton_s_per_m", friction.viscosity_newton_s_per_m,
            friction.stiffness_newton_per_m);
  }
  void operator()(const Detents& detents) noexcept {
    position("origin_m", detents.origin_m);
    direction("direction", detents.direction);
    number("spacing_m", detents.spacing_m, kLengthMinMetre, kExtentMetre);
    // The stiffness of a detent is 2π · force / spacing.
    const double force_max =
        limits_.stiffness_newton_per_m_max * detents.spacing_m / (2 * std::numbers::pi);
    number("force_newton", detents.force_newton, 0, std::min(force_max, limits_.force_newton_max));
    damping("damping_newton_s_per_m", detents.damping_newton_s_per_m,
            2 * std::numbers::pi * detents.force_newton / detents.spacing_m);
  }
  void operator()(const DialDetents& detents) noexcept;

 private:
  void number(std::string_view field, double value, double low, double high) noexcept {
    if (error_ || (std::isfinite(value) && value >= low && value <= high)) return;
    error_ = ModelError{index_, kind_, field, value, low, high};
  }
  void position(std::string_view field, const driver::Vector3& at) noexcept {
    for (const double value : {at.x, at.y, at.z})
      number(field, value, -kExtentMetre, kExtentMetre);
  }
  void direction(std::string_view field, const driver::Vector3& along) noexcept {
    number(field, length(along), 1 - kUnitTolerance, 1 + kUnitTolerance);
  }
  void side(Side value) noexcept { number("side", static_cast<double>(value), 0, kSideCount - 1); }
  template <class WithStiffness>
  void surface(const WithStiffness& model) noexcept {
    number("stiffness_newton_per_m", model.stiffness_newton_per_m, 0,
           limits_.stiffness_newton_per_m_max);
    damping("damping_newton_s_per_m", model.damping_newton_s_per_m, model.stiffness_newton_per_m);
  }
  /// Damping may use the part of the passive range that the stiffness leaves.
  void damping(std::string_view field, double value, double stiffness_newton_per_m) noexcept {
    number(field, value, 0,
           rest(limits_.damping_newton_s_per_m_max, stiffness_newton_per_m,
                limits_.stiffness_newton_per_m_max));
  }
  [[nodiscard]] static double rest(double damping_max, double stiffness,
                                   double stiffness_max) noexcept {
    return stiffness_max > 0 ? damping_max * std::max(0.0, 1 - stiffness / stiffness_max) : 0;
  }

  std::size_t index_;
  std::string_view kind_;
  const ModelLimits& limits_;
  std::optional<ModelError> error_{};
};

void Checker::operator()(const AffineField& field) noexcept {
  position("origin_m", field.origin_m);
  // NaN is neither above nor below a bound, and makes the length NaN, too.
  const double force_newton = length(field.force_newton);
  number("force_newton", force_newton, 0, limits_.force_newton_max);
  double square = 0;
  for (const double element : field.jacobian_newton_per_m)
    square += element * element;
  // The Frobenius norm, which no direction's stiffness exceeds. A quarter leaves room for the fade.
  const double stiffness = std::sqrt(square);
  const double stiffness_max = limits_.stiffness_newton_per_m_max;
  number("jacobian_newton_per_m", stiffness, 0, stiffness_max / 4);
  number("radius_m", field.radius_m, 0, kExtentMetre);
  // The fade adds its greatest force over its width:
  // K + (F + K · (radius + fade)) / fade ≤ stiffness max, solved for the fade.
  const double fade_min_m =
      (force_newton + stiffness * field.radius_m) / (stiffness_max - 2 * stiffness);
  number("fade_m", field.fade_m, std::max(kLengthMinMetre, fade_min_m), kExtentMetre);
}

void Checker::operator()(const DialDetents& detents) noexcept {
  number("joint", detents.joint, 0, driver::kJointCountMax - 1);
  if (error_) return;
  const double effort_max = limits_.efforts_newton_metre_max[detents.joint];
  const double stiffness_max = limits_.stiffness_newton_metre_per_rad_max[detents.joint];
  const double damping_max = limits_.damping_newton_metre_s_per_rad_max[detents.joint];
  number("origin_rad", detents.origin_rad, -kAngleMaxRad, kAngleMaxRad);
  number("spacing_rad", detents.spacing_rad, kSpacingMinRad, kAngleMaxRad);
  number("effort_newton_metre", detents.effort_newton_metre, 0,
         std::min(effort_max, stiffness_max * detents.spacing_rad / (2 * std::numbers::pi)));
  const double detent_stiffness =
      2 * std::numbers::pi * detents.effort_newton_metre / detents.spacing_rad;
  number("low_rad", detents.low_rad, -kAngleMaxRad, kAngleMaxRad);
  number("high_rad", detents.high_rad, detents.low_rad, kAngleMaxRad);
  number("end_stiffness_newton_metre_per_rad", detents.end_stiffness_newton_metre_per_rad, 0,
         stiffness_max);
  number("damping_newton_metre_s_per_rad", detents.damping_newton_metre_s_per_rad, 0,
         rest(damping_max, std::max(detent_stiffness, detents.end_stiffness_newton_metre_per_rad),
              stiffness_max));
}

}  // namespace

std::string_view to_string(const Model& model) noexcept {
  static constexpr std::array<std::string_view, std::variant_size_v<Model>> kNames{
      "plane", "sphere", "box", "spring", "affine field", "friction", "detents", "dial detents"};
  return kNames[model.index()];
}

std::string to_text(const ModelError& error) {
  std::array<char, 192> text{};
  std::snprintf(text.data(), text.size(), "model %zu (%.*s): %.*s is %.4g; choose %.4g to %.4g",
                error.index, static_cast<int>(error.kind.size()), error.kind.data(),
                static_cast<int>(error.field.size()), error.field.data(), error.value, error.low,
                error.high);
  return text.data();
}

expected<void, ModelError> check(const ModelList& list, const ModelLimits& limits) noexcept {
  std::size_t index = 0;
  for (const Model& model : list.models()) {
    Checker checker(index++, model, limits);
    std::visit(checker, model);
    if (checker.error()) return unexpected{*checker.error()};
  }
  return {};
}

}  // namespace rtpm::gvd
