#pragma once

#include <cstddef>
#include <cstdint>

#include "rtpm/schema/model.hpp"

namespace rtpm::schema {

/// The bounds of every valid message of a table.
struct VerifyLimits {
  std::uint32_t depth = 1;   ///< Nesting depth of tables, including the root.
  std::uint32_t tables = 1;  ///< If 0, only the message's size limits their number.
};

/// The depth limit of a table that may contain itself.
inline constexpr std::uint32_t kRecursiveDepth = 32;

/// The limits for the table `index` of Model::objects.
[[nodiscard]] VerifyLimits verify_limits(const Model& model, std::size_t index);

}  // namespace rtpm::schema
