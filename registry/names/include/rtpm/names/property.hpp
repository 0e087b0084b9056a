#pragma once

#include <cstddef>

#include "rtpm/predicate/value.hpp"

namespace rtpm::names {

/// A typed value of a binding, for find(): {"force_newton_max", 3.3, "newton"}.
///
/// Its name consists of letters, digits, '_' and '.', and does not start with a digit. A text, even
/// in a list, has at most kPropertyTextSizeMax printable bytes of UTF-8; numbers are finite. Every
/// binding also has the built-in texts `name`, `url`, `interface` and `host` (of the URL) for
/// predicates.
using predicate::Property;
using PropertyList = predicate::List;
using PropertyType = predicate::Type;
using PropertyValue = predicate::Value;

inline constexpr std::size_t kPropertyCountMax = 32;  ///< Properties per binding.
inline constexpr std::size_t kPropertyNameSizeMax = 64;
inline constexpr std::size_t kPropertyUnitSizeMax = 32;
inline constexpr std::size_t kPropertyTextSizeMax = 256;
inline constexpr std::size_t kPropertyListSizeMax = 64;

}  // namespace rtpm::names
