#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "rtpm/schema/model.hpp"

namespace rtpm::schema {

/// Reads FlatBuffers' reflection, the content of a .bfbs. Attributes stay texts, which the checker
/// interprets.
/// @param declaration_file  only services declared in this file are taken
/// @errors                  nullopt: not a reflection, or one with unknown types
[[nodiscard]] std::optional<Model> read_reflection(std::span<const std::uint8_t> bytes,
                                                   const std::string& declaration_file);

/// Reads a model with all services. Assumes that the compiled file is the first service's or,
/// without services, the first type's. Arrays that Dynamic::flat_reflection() wrote as fields are
/// arrays again.
[[nodiscard]] std::optional<Model> read_reflection(std::span<const std::uint8_t> bytes);

}  // namespace rtpm::schema
