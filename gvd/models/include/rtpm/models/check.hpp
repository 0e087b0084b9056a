#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

#include "rtpm/base/expected.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/driver/descriptor.hpp"
#include "rtpm/models/model.hpp"

namespace rtpm::gvd {

/// The most that a model may demand of a device. Stiffness K and damping B of one model share the
/// passive range of a loop with this period: K / stiffness max + B / damping max ≤ 1. Overlapping
/// models add up: the safety filter bounds the sum.
/// @ownership a value
struct ModelLimits {
  /// The largest position and length: far beyond any workspace, yet no force overflows.
  static constexpr double kExtentMaxMetre = 100;

  double force_newton_max = 0;  ///< 0 if the device takes no force.
  double stiffness_newton_per_m_max = 0;
  double damping_newton_s_per_m_max = 0;
  /// The limit of each joint; 0 if it does not turn, or accepts no efforts.
  std::array<double, driver::kJointCountMax> efforts_newton_metre_max{};
  std::array<double, driver::kJointCountMax> stiffness_newton_metre_per_rad_max{};
  std::array<double, driver::kJointCountMax> damping_newton_metre_s_per_rad_max{};

  /// The limits of a device whose loop runs every `period`:
  /// - damping max: the mechanics' own b, or 1.5 · device period · its stiffness max if it names
  ///   none;
  /// - stiffness max: b / (1.5 · period), as a position is one period old when its force acts; the
  ///   force is then held for one period, half a period on average; at most the descriptor's own;
  /// - for a joint, whose damping descriptors do not state, a plausible bound only: its full effort
  ///   over 0.02 rad, for periods above 1 ms over a proportionally larger angle; and at 1 rad/s.
  /// @source   Colgate's condition for sampled walls, b > K · (T / 2 + delay) + B
  /// @realtime alloc-free
  [[nodiscard]] static ModelLimits for_device(const driver::Descriptor& descriptor,
                                              Duration period) noexcept;
};

/// Why a list was refused: a field of one of its models is out of range.
/// @ownership a value; the name is static
struct ModelError {
  std::size_t index = 0;     ///< The index of the model, from 0.
  std::string_view kind{};   ///< A word of to_string(Model).
  std::string_view field{};  ///< "stiffness_newton_per_m".
  double value = 0;          ///< May be a NaN. For a direction: its length.
  double low = 0;            ///< The range, bounds included.
  double high = 0;
};

/// "model 2 (plane): stiffness_newton_per_m is 1e+09; choose 0 to 1667".
/// @realtime set-up only
[[nodiscard]] std::string to_text(const ModelError& error);

/// Whether a device with `limits` may render `list`; always true for an empty list.
/// @realtime alloc-free
/// @errors   the first field that is not finite or out of range
[[nodiscard]] expected<void, ModelError> check(const ModelList& list,
                                               const ModelLimits& limits) noexcept;

}  // namespace rtpm::gvd
