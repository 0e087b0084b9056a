#pragma once

#include <cstddef>
#include <cstdint>

#include "rtpm/schema/model.hpp"

namespace rtpm::schema {

/// How far the verification of a table need go, because no message of its schema goes further.
struct VerifyLimits {
  std::uint32_t depth = 1;  ///< Tables in each other, the root included.
  std::uint32_t tables =
      1;  ///< Tables in all; 0: the schema sets no bound, the message's size does.
};

/// Of a table that may hold itself: nobody nests deeper on purpose.
inline constexpr std::uint32_t kRecursiveDepth = 32;

/// The limits for the table `index` of Model::objects.
[[nodiscard]] VerifyLimits verify_limits(const Model& model, std::size_t index);

}  // namespace rtpm::schema
