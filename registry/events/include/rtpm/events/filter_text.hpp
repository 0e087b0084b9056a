#pragma once

#include <cstddef>
#include <span>
#include <string_view>

#include "rtpm/base/expected.hpp"
#include "rtpm/events/filter.hpp"
#include "rtpm/events/scalar.hpp"
#include "rtpm/predicate/text_error.hpp"

/// Filters as text, with one syntax for tools, files and programs: registry/events/FILTERS.md.
///
///     type(lab.Touched) and source(3) and force.z > 2 within 5ms of type(lab.Gaze)
namespace rtpm::events {

/// Maximum size of a filter text, in bytes.
inline constexpr std::size_t kFilterTextSizeMax = 16 * 1024;

using FilterTextError = predicate::TextError;

/// Parses a filter. Type and field names are looked up in `types`; a type may also be a number.
/// @realtime set-up only
/// @errors   the text is malformed, names an unknown type or field, compares with a value that the
///           field can't have, or exceeds a limit of filters
[[nodiscard]] expected<Filter, FilterTextError> parse_filter(
    std::string_view text, std::span<const EventDescriptor* const> types);

}  // namespace rtpm::events
