#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "rtpm/schema/model.hpp"

namespace rtpm::schema {

/// A number of an event's payload that filters can read.
struct EventField {
  std::string name{};  ///< With dots through structs and tables.
  BaseType type = BaseType::kNone;
  std::vector<std::uint16_t> slots{};  ///< One per nested table; none in a bare struct.
  std::size_t offset = 0;              ///< In the last slot's struct, in bytes.
  const Field* field = nullptr;        ///< Has the default. @ownership the model's
};

/// The numbers of an event's payload, outside arrays, vectors and unions: those of tables that nest
/// at most 4 deep, at most 256.
[[nodiscard]] std::vector<EventField> event_fields(const Model& model, const Payload& payload);

/// Whether filters read a number as one without a sign.
[[nodiscard]] bool is_unsigned(BaseType type) noexcept;

}  // namespace rtpm::schema
