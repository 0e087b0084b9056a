#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "rtpm/models/check.hpp"
#include "rtpm/models/model.hpp"

/// Random models that pass the check, for property tests.
namespace rtpm::gvd::test {

/// An arm with 9 N and a motorised joint 0, at 1 kHz.
inline driver::Descriptor arm() {
  driver::Descriptor descriptor;
  descriptor.modes = {driver::CommandMode::kForce, driver::CommandMode::kJointEffort};
  descriptor.limits = {9, 0.5, 1600, 2.5};
  descriptor.joints = {{"dial", "rad", 0, 0, 0, 0.05}};
  return descriptor;
}

inline ModelLimits arm_limits() {
  return ModelLimits::for_device(arm(), std::chrono::milliseconds{1});
}

/// A model within arm_limits(), near the workspace's middle, mostly near its limits.
inline Model random_model(std::mt19937_64& random) {
  const ModelLimits limits = arm_limits();
  const auto between = [&random](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  const auto point = [&] {
    return driver::Vector3{between(-0.1, 0.1), between(-0.1, 0.1), between(-0.1, 0.1)};
  };
  const auto direction = [&] {
    const driver::Vector3 along = {between(-1, 1), between(-1, 1), between(0.1, 1)};
    const double length = std::hypot(along.x, along.y, along.z);
    return driver::Vector3{along.x / length, along.y / length, along.z / length};
  };
  const double share = between(0, 1);
  const double stiffness = share * limits.stiffness_newton_per_m_max;
  const double damping = (1 - share) * between(0, 0.999) * limits.damping_newton_s_per_m_max;
  const double force = between(0, limits.force_newton_max);
  const auto side = static_cast<Side>(random() % kSideCount);
  switch (random() % std::variant_size_v<Model>) {
    case 0:
      return Plane{point(), direction(), stiffness, damping};
    case 1:
      return Sphere{point(), between(0.01, 0.1), side, stiffness, damping};
    case 2: {
      const driver::Vector3 low = point();
      const driver::Vector3 high{low.x + between(0.01, 0.1), low.y + between(0.01, 0.1),
                                 low.z + between(0.01, 0.1)};
      return Box{low, high, side, stiffness, damping};
    }
    case 3:
      return Spring{point(), stiffness, damping, force};
    case 4: {
      AffineField field{point(), {between(-2, 2), between(-2, 2), between(-2, 2)}, {}, 0, 0};
      for (double& element : field.jacobian_newton_per_m)
        element = between(-100, 100);
      field.radius_m = between(0, 0.1);
      field.fade_m = between(0.05, 0.1);
      return field;
    }
    case 5:
      return Friction{force, std::max(stiffness, 1.0), damping * 0.99};
    case 6: {
      const double spacing_m = between(0.002, 0.05);
      const double most = limits.stiffness_newton_per_m_max * spacing_m / (2 * std::numbers::pi);
      return Detents{point(), direction(), spacing_m,
                     share * std::min(most, limits.force_newton_max), damping};
    }
    default:
      return DialDetents{.spacing_rad = 0.3,
                         .effort_newton_metre = share * 0.05,
                         .damping_newton_metre_s_per_rad = (1 - share) * 0.02};
  }
}

/// A list of one to ModelList::kCountMax random models.
inline ModelList random_list(std::mt19937_64& random) {
  std::vector<Model> models;
  for (std::size_t count = 1 + random() % ModelList::kCountMax; count > 0; --count)
    models.push_back(random_model(random));
  return ModelList{models};
}

}  // namespace rtpm::gvd::test
