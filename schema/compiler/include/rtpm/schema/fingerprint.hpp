#pragma once

#include <cstdint>
#include <string>

#include "rtpm/schema/model.hpp"

/// A fingerprint is a hash (FNV-1a, 64 bits) of a text that holds all that both sides of a call
/// must agree on, and nothing else. Two schemas with the same text understand each other.
///
/// Part of the text, for each method: its id and name, whether it is idempotent (a caller of an
/// idempotent method repeats it, so the server must mean the same), oneway and at which level, or a
/// stream, the kinds and tables of its request and reply, and every type reached from them, once
/// each, by name:
///   tables   each field's slot, name, type, default, and `required`, `optional`, `deprecated`,
///            `key`, `nested_flatbuffer`, `flexbuffer`, `force_align`;
///   structs  size, alignment, and each field's offset, name and type;
///   both     each field's rtpm_unit and rtpm_frame: the same number in another unit is another;
///   enums    underlying type, each value's name and number; unions: also each value's type.
/// Names count although FlatBuffers' bytes lack them: Force{x,y} and Torque{x,y} look alike on the
/// wire and do not mean the same.
///
/// Not part: comments, file names and folders, the order of declarations, other methods (in a
/// method's text), what each side decides for itself (rtpm_deadline_us, rtpm_deferred,
/// rtpm_priority), limits (rtpm_range, rtpm_max_size), attributes of other tools.
namespace rtpm::schema {

/// The text of one method; a back end or a person may compare two to see what differs.
[[nodiscard]] std::string canonical_text(const Model& model, const Method& method);
/// The text of a service: its name and its methods' texts by id.
[[nodiscard]] std::string canonical_text(const Model& model, const Service& service);

/// What a server tells of its interface, so that clients of other versions can compare it with
/// theirs: as the text of the service, but each type once, behind all methods.
/// Source: spec/hprotocol.md#hp-12.2.
[[nodiscard]] std::string interface_text(const Model& model, const Service& service);

/// The text of an event, one of the model's own objects: its number, name and types.
[[nodiscard]] std::string canonical_text(const Model& model, const Object& event);

/// Sets the fingerprints of all services, methods and events of `model`. A method's are the two
/// halves of its hash, combined to 32 bits by exclusive or.
void set_fingerprints(Model& model);

}  // namespace rtpm::schema
