#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "rtpm/schema/model.hpp"

namespace rtpm::exports {

/// One column of the rows that a channel's messages are.
struct Column {
  enum class Kind : std::uint8_t {
    kNumber,
    kText,
    kJson,  ///< A vector, a union, or a table inside itself.
  };
  Kind kind = Kind::kNumber;
  std::string name{};  ///< "pose.position_m.x", "joints[3]".
  std::string unit{};  ///< `rtpm_unit`; empty if not stated.
  /// The slots of the tables on the way, from the root; the last is of the value or its struct.
  std::vector<std::uint16_t> slots{};
  std::size_t offset = 0;                ///< In the struct of the last slot, in bytes.
  bool is_in_struct = false;             ///< Else the last slot is the value's own.
  schema::Type type{};                   ///< An array has its element's.
  const schema::Field* field = nullptr;  ///< The value's, in a table; refers to the model.
};

/// The columns of a table: fields of tables and structs, and elements of arrays, have their own. A
/// table that holds only one struct is that struct.
/// @return   nullopt if there would be too many
[[nodiscard]] std::optional<std::vector<Column>> columns_of(const schema::Model& model,
                                                            std::size_t table);

}  // namespace rtpm::exports
