#pragma once

#include <array>
#include <cstddef>
#include <optional>

#include "rtpm/driver/command.hpp"
#include "rtpm/driver/geometry.hpp"
#include "rtpm/driver/sample.hpp"
#include "rtpm/models/model.hpp"

namespace rtpm::gvd {

/// The models' request to the actuators.
/// @ownership a value
struct ModelForces {
  driver::Wrench wrench{};  ///< On the end effector; no model has a torque.
  /// The dial detents' efforts, in newton metre.
  std::array<double, driver::kJointCountMax> efforts{};
};

/// Renders a list of models. Its state is one contact point per friction model, which stays within
/// force / stiffness of the end effector.
/// @ownership a value
/// @threads  one at a time
/// @realtime alloc-free; reads no clock
class Evaluator {
 public:
  /// Replaces the list as a whole by `list`, which has passed check(). A model that stays the same
  /// at its index keeps its state.
  void set(const ModelList& list) noexcept;
  void clear() noexcept { set({}); }
  [[nodiscard]] bool is_empty() const noexcept { return list_.is_empty(); }

  /// The sum of the models' forces at `sample`, finite for every finite sample.
  [[nodiscard]] ModelForces evaluate(const driver::Sample& sample) noexcept;

 private:
  ModelList list_{};
  /// Where friction model i touches; nullopt before its first evaluation.
  std::array<std::optional<driver::Vector3>, ModelList::kCountMax> contacts_m_{};
};

}  // namespace rtpm::gvd
