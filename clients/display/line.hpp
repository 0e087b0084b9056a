#pragma once

#include <span>
#include <string>

#include "rtpm/driver/descriptor.hpp"
#include "rtpm/driver/sample.hpp"

/// Shows any device in one line of text, according to its description.
namespace rtpm::display {

/// The device's first value, which is plotted: the force of an actuated device, otherwise an angle,
/// a joint, an analog or an output.
/// @realtime set-up only
[[nodiscard]] double first_value(const driver::Descriptor& descriptor,
                                 const driver::Sample& sample) noexcept;

/// The values of a sample: "at +22.0 -21.2 -5.0 mm   force 2.99 N".
/// @realtime set-up only
[[nodiscard]] std::string values_text(const driver::Descriptor& descriptor,
                                      const driver::Sample& sample);

/// Plots `values` in one row, scaled from the lowest to the highest value, with one block of U+2581
/// to U+2588 for each.
/// @realtime set-up only
[[nodiscard]] std::string curve_text(std::span<const double> values);

/// The width in columns of a text of ASCII, Latin and block characters.
[[nodiscard]] std::size_t width_of(std::string_view text) noexcept;

/// `text`, padded with blanks or truncated to `width` columns.
[[nodiscard]] std::string fitted(std::string_view text, std::size_t width);

}  // namespace rtpm::display
