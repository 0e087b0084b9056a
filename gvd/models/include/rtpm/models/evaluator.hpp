#pragma once

#include <array>
#include <cstddef>
#include <optional>

#include "rtpm/driver/command.hpp"
#include "rtpm/driver/geometry.hpp"
#include "rtpm/driver/sample.hpp"
#include "rtpm/models/model.hpp"

namespace rtpm::gvd {

/// The forces and efforts that the models ask the actuators for.
/// @ownership a value
struct ModelForces {
  driver::Wrench wrench{};  ///< On the end effector; no model has a torque.
  /// The dial detents' efforts, in newton metre.
  std::array<double, driver::kJointCountMax> efforts{};
};

/// Renders a list of models. Its state is one contact point per friction model, at most force /
/// stiffness away from the end effector.
/// @ownership a value
/// @threads  one at a time
/// @realtime alloc-free; reads no clock
class Evaluator {
 public:
  /// Replaces the whole list by `list`, which has passed check(). A model that is unchanged at its
  /// index keeps its state.
  void set(const ModelList& list) noexcept;
  void clear() noexcept { set({}); }
  [[nodiscard]] bool is_empty() const noexcept { return list_.is_empty(); }
  [[nodiscard]] const ModelList& list() const noexcept { return list_; }

  /// The sum of the models' forces at `sample`, finite for every finite sample.
  [[nodiscard]] ModelForces evaluate(const driver::Sample& sample) noexcept;

 private:
  ModelList list_{};
  /// The contact point of friction model i; nullopt before its first evaluation.
  std::array<std::optional<driver::Vector3>, ModelList::kCountMax> contacts_m_{};
};

}  // namespace rtpm::gvd
