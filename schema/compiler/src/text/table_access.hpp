#pragma once

#include <flatbuffers/flatbuffers.h>

#include <cstddef>
#include <cstdint>

#include "rtpm/schema/model.hpp"

/// Access to the bytes of a verified FlatBuffer.
namespace rtpm::schema {

/// The slot of a table's field in its vtable.
[[nodiscard]] inline flatbuffers::voffset_t slot_of(std::size_t id) noexcept {
  return static_cast<flatbuffers::voffset_t>(4 + 2 * id);
}

/// Follows the offset stored at `offset`.
[[nodiscard]] inline const std::uint8_t* follow(const std::uint8_t* offset) noexcept {
  return offset + flatbuffers::ReadScalar<flatbuffers::uoffset_t>(offset);
}

/// The size of a number, in bytes.
[[nodiscard]] inline std::size_t size_of(BaseType type) noexcept {
  switch (type) {
    case BaseType::kInt16:
    case BaseType::kUint16:
      return 2;
    case BaseType::kInt32:
    case BaseType::kUint32:
    case BaseType::kFloat:
      return 4;
    case BaseType::kInt64:
    case BaseType::kUint64:
    case BaseType::kDouble:
      return 8;
    default:
      return 1;
  }
}

}  // namespace rtpm::schema
