#pragma once

#include <span>
#include <string>

#include "rtpm/driver/descriptor.hpp"
#include "rtpm/driver/sample.hpp"

/// Shows any device in one line of text, by its description.
namespace rtpm::display {

/// The device's first value, whose curve is shown: the force of an actuated device, otherwise an
/// angle, a joint, an analog or an output.
/// @realtime set-up only
[[nodiscard]] double first_value(const driver::Descriptor& descriptor,
                                 const driver::Sample& sample) noexcept;

/// The values of a sample: "at +22.0 -21.2 -5.0 mm   force 2.99 N".
/// @realtime set-up only
[[nodiscard]] std::string values_text(const driver::Descriptor& descriptor,
                                      const driver::Sample& sample);

/// `values` as a curve of one row, scaled from the least to the greatest of them; one block of
/// U+2581 to U+2588 for each.
/// @realtime set-up only
[[nodiscard]] std::string curve_text(std::span<const double> values);

/// The number of columns that a text of ASCII, Latin and blocks takes.
[[nodiscard]] std::size_t width_of(std::string_view text) noexcept;

/// `text`, filled with blanks or cut to `width` columns.
[[nodiscard]] std::string fitted(std::string_view text, std::size_t width);

}  // namespace rtpm::display
