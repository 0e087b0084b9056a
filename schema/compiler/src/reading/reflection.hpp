#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "rtpm/schema/model.hpp"

namespace rtpm::schema {

/// Reads FlatBuffers' reflection (the content of a .bfbs file), the only form in which this
/// compiler knows a schema. Of the services, only those that `declaration_file` declares are taken.
/// Method ids and other attributes are kept as text: the checker gives them their meaning. Returns
/// nothing if the bytes are no such reflection.
[[nodiscard]] std::optional<Model> read_reflection(std::span<const std::uint8_t> bytes,
                                                   const std::string& declaration_file);

/// The same of bytes that do not say which file is the compiled one: all services are taken, and
/// the file of the first one is it, or of the first type if there is no service.
[[nodiscard]] std::optional<Model> read_reflection(std::span<const std::uint8_t> bytes);

/// The payload rule: the kind of a table as a request or reply.
[[nodiscard]] Payload payload_of(const Model& model, std::size_t table);

}  // namespace rtpm::schema
