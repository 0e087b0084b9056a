#pragma once

#include <cstdint>
#include <string>

#include "rtpm/schema/model.hpp"

/// A fingerprint is a hash (FNV-1a, 64 bits) of a canonical text of everything that both sides of a
/// call must agree on.
///
/// The text has, for each method: id, name, idempotent (clients repeat such calls, so both sides
/// must agree), oneway and its level, stream, the kinds and tables of request and reply, and every
/// type reached from them, once, by name:
///   tables   each field's slot, name, type, default, and `required`, `optional`, `deprecated`,
///            `key`, `nested_flatbuffer`, `flexbuffer`, `force_align`;
///   structs  size, alignment, and each field's offset, name and type;
///   both     each field's rtpm_unit and rtpm_frame, which change a number's meaning;
///   enums    underlying type, each value's name and number; unions: also each value's type.
/// Names count because types with the same layout can differ in meaning: Force{x,y}, Torque{x,y}.
///
/// Not included: comments, file names, the order of declarations, other methods, decisions of one
/// side alone (rtpm_deadline_us, rtpm_deferred, rtpm_priority), limits (rtpm_range, rtpm_max_size),
/// attributes of other tools.
namespace rtpm::schema {

/// The canonical text of one method.
[[nodiscard]] std::string canonical_text(const Model& model, const Method& method);
/// The canonical text of a service: its name, then the texts of its methods by id.
[[nodiscard]] std::string canonical_text(const Model& model, const Service& service);

/// The text that a server sends so that clients of other versions can compare it with theirs: the
/// service's text, but with each type once, after all methods.
/// @source spec/hprotocol.md#hp-12.2
[[nodiscard]] std::string interface_text(const Model& model, const Service& service);

/// The canonical text of an event: its number, name and types.
/// @param event  an element of `model.objects`
[[nodiscard]] std::string canonical_text(const Model& model, const Object& event);

/// Sets the fingerprints of all services, methods and events of `model`. A method's has 32 bits:
/// the two halves of its hash, combined by exclusive or.
void set_fingerprints(Model& model);

}  // namespace rtpm::schema
