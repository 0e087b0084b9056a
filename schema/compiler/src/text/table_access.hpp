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

}  // namespace rtpm::schema
