#pragma once

#include <string_view>

#include "rtpm/base/time.hpp"
#include "rtpm/driver/sample.hpp"

namespace rtpm::gvd {

/// The first field of `sample` that has a NaN or an infinity: "twist". Empty if there is none.
/// @realtime alloc-free
[[nodiscard]] std::string_view not_finite_field(const driver::Sample& sample) noexcept;

/// The interval in which a sample may have been measured.
struct MeasurementTimes {
  MonotonicTime opened{};  ///< When the device was opened.
  MonotonicTime cycle{};   ///< When the cycle took the sample.
  Duration period{};
};

/// Whether pose and time of a finite sample are plausible, see driver::Fault::kImplausible.
/// @realtime alloc-free
[[nodiscard]] bool is_plausible(const driver::Sample& sample,
                                const MeasurementTimes& times) noexcept;

}  // namespace rtpm::gvd
