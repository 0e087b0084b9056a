#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "rtpm/schema/model.hpp"

namespace rtpm::schema {

/// Reads FlatBuffers' reflection, the content of a .bfbs. Attributes stay texts, which the checker
/// interprets.
/// @param declaration_file  only services that this file declares are taken
/// @errors                  nothing: not a reflection, or one with unknown types
[[nodiscard]] std::optional<Model> read_reflection(std::span<const std::uint8_t> bytes,
                                                   const std::string& declaration_file);

/// Reads a model with all services. The compiled file is assumed to be that of the first service,
/// or of the first type if there is no service.
[[nodiscard]] std::optional<Model> read_reflection(std::span<const std::uint8_t> bytes);

/// The encoding of a table as a request or reply.
[[nodiscard]] Payload payload_of(const Model& model, std::size_t table);

}  // namespace rtpm::schema
