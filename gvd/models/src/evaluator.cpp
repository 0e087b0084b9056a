#include "rtpm/models/evaluator.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "rtpm/driver/vector.hpp"

namespace rtpm::gvd {
namespace {

using driver::Vector3;

/// The position of the end effector relative to a material.
struct Contact {
  double depth_m = 0;  ///< Positive inside.
  Vector3 normal{};    ///< Points out of the material.
};

Contact contact_of(const Plane& plane, const Vector3& at_m) noexcept {
  return {dot(difference(plane.point_m, at_m), plane.normal), plane.normal};
}

Contact contact_of(const Sphere& sphere, const Vector3& at_m) noexcept {
  const Vector3 out = difference(at_m, sphere.centre_m);
  const double distance_m = length(out);
  if (!(distance_m > 0)) return {};
  const bool is_solid = sphere.side == Side::kSolid;
  const double depth_m = is_solid ? sphere.radius_m - distance_m : distance_m - sphere.radius_m;
  return {depth_m, scaled(out, (is_solid ? 1 : -1) / distance_m)};
}

Contact contact_in_solid(const Box& box, const Vector3& at_m) noexcept {
  const std::array<Contact, 6> faces{{{at_m.x - box.low_m.x, {-1, 0, 0}},
                                      {box.high_m.x - at_m.x, {1, 0, 0}},
                                      {at_m.y - box.low_m.y, {0, -1, 0}},
                                      {box.high_m.y - at_m.y, {0, 1, 0}},
                                      {at_m.z - box.low_m.z, {0, 0, -1}},
                                      {box.high_m.z - at_m.z, {0, 0, 1}}}};
  return *std::ranges::min_element(faces, {}, &Contact::depth_m);
}

Contact contact_of(const Box& box, const Vector3& at_m) noexcept {
  if (box.side == Side::kSolid) return contact_in_solid(box, at_m);
  const Vector3 back = {std::clamp(at_m.x, box.low_m.x, box.high_m.x) - at_m.x,
                        std::clamp(at_m.y, box.low_m.y, box.high_m.y) - at_m.y,
                        std::clamp(at_m.z, box.low_m.z, box.high_m.z) - at_m.z};
  const double depth_m = length(back);
  if (!(depth_m > 0)) return {};
  return {depth_m, scaled(back, 1 / depth_m)};
}

/// Sums the forces of models at one sample.
class Summation {
 public:
  Summation(const driver::Sample& sample, ModelForces& forces) noexcept
      : sample_(sample),
        at_m_(sample.pose.position_m),
        velocity_(sample.twist.linear_m_per_s),
        forces_(forces) {}

  void add(const Plane& plane, std::optional<Vector3>&) noexcept { add_surface(plane); }
  void add(const Sphere& sphere, std::optional<Vector3>&) noexcept { add_surface(sphere); }
  void add(const Box& box, std::optional<Vector3>&) noexcept { add_surface(box); }

  void add(const Spring& spring, std::optional<Vector3>&) noexcept {
    const Vector3 pull = scaled(difference(spring.anchor_m, at_m_), spring.stiffness_newton_per_m);
    add_force(shortened(pull, spring.force_newton_max));
    add_force(scaled(velocity_, -spring.damping_newton_s_per_m));
  }

  void add(const AffineField& field, std::optional<Vector3>&) noexcept {
    const Vector3 from = difference(at_m_, field.origin_m);
    const double beyond_m = length(from) - field.radius_m;
    if (beyond_m >= field.fade_m) return;
    const double fade = std::min(1.0, 1 - beyond_m / field.fade_m);
    const std::array<double, 9>& j = field.jacobian_newton_per_m;
    const Vector3 change{dot({j[0], j[1], j[2]}, from), dot({j[3], j[4], j[5]}, from),
                         dot({j[6], j[7], j[8]}, from)};
    add_force(scaled(sum(field.force_newton, change), fade));
  }

  void add(const Friction& friction, std::optional<Vector3>& contact_m) noexcept {
    add_force(scaled(velocity_, -friction.viscosity_newton_s_per_m));
    if (!(friction.force_newton > 0)) return;
    if (!contact_m) contact_m = at_m_;
    const Vector3 stretch = shortened(difference(at_m_, *contact_m),
                                      friction.force_newton / friction.stiffness_newton_per_m);
    contact_m = difference(at_m_, stretch);
    add_force(scaled(stretch, -friction.stiffness_newton_per_m));
  }

  void add(const Detents& detents, std::optional<Vector3>&) noexcept {
    const double way_m = dot(difference(at_m_, detents.origin_m), detents.direction);
    const double newton =
        detents.force_newton * std::sin(2 * std::numbers::pi * way_m / detents.spacing_m) +
        detents.damping_newton_s_per_m * dot(velocity_, detents.direction);
    add_force(scaled(detents.direction, -newton));
  }

  void add(const DialDetents& detents, std::optional<Vector3>&) noexcept {
    const double angle_rad = sample_.joints[detents.joint];
    const bool has_ends = detents.low_rad < detents.high_rad;
    const double inside_rad =
        has_ends ? std::clamp(angle_rad, detents.low_rad, detents.high_rad) : angle_rad;
    const double phase_rad =
        2 * std::numbers::pi * (inside_rad - detents.origin_rad) / detents.spacing_rad;
    forces_.efforts[detents.joint] +=
        detents.end_stiffness_newton_metre_per_rad * (inside_rad - angle_rad) -
        detents.effort_newton_metre * std::sin(phase_rad) -
        detents.damping_newton_metre_s_per_rad * sample_.joint_velocities[detents.joint];
  }

 private:
  void add_force(const Vector3& newton) noexcept {
    forces_.wrench.force_newton = sum(forces_.wrench.force_newton, newton);
  }
  template <class Surface>
  void add_surface(const Surface& surface) noexcept {
    const Contact contact = contact_of(surface, at_m_);
    if (!(contact.depth_m > 0)) return;
    const double newton = surface.stiffness_newton_per_m * contact.depth_m -
                          surface.damping_newton_s_per_m * dot(velocity_, contact.normal);
    add_force(scaled(contact.normal, std::max(0.0, newton)));
  }

  const driver::Sample& sample_;
  const Vector3& at_m_;
  const Vector3& velocity_;
  ModelForces& forces_;
};

}  // namespace

void Evaluator::set(const ModelList& list) noexcept {
  const auto before = list_.models();
  const auto after = list.models();
  for (std::size_t i = 0; i < contacts_m_.size(); ++i) {
    const bool is_kept = i < before.size() && i < after.size() && before[i] == after[i];
    if (!is_kept) contacts_m_[i].reset();
  }
  list_ = list;
}

ModelForces Evaluator::evaluate(const driver::Sample& sample) noexcept {
  ModelForces forces;
  Summation summation(sample, forces);
  const auto models = list_.models();
  for (std::size_t i = 0; i < models.size(); ++i) {
    std::visit([&](const auto& model) { summation.add(model, contacts_m_[i]); }, models[i]);
  }
  // A sample far outside any workspace may overflow.
  if (!is_finite(forces.wrench.force_newton)) forces.wrench = {};
  for (double& effort : forces.efforts)
    if (!std::isfinite(effort)) effort = 0;
  for (auto& contact_m : contacts_m_)
    if (contact_m && !is_finite(*contact_m)) contact_m.reset();
  return forces;
}

}  // namespace rtpm::gvd
