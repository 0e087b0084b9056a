#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/schema/model.hpp"

namespace rtpm::schema {

/// Converts requests and replies of services, and the payloads of events, to and from JSON, for
/// tools without generated code.
///
/// The JSON is an object with the table's fields or, for a payload that is a bare struct, with the
/// struct's fields: `{x: 1, y: 2}`, which may also be enclosed in the table's field: `{force: {x:
/// 1, y: 2}}`. Names need no quotation marks. Absent fields of tables have their defaults; fields
/// of structs have none. Numbers that JSON can't represent are written as null.
/// @ownership owns all its data
/// @threads  one at a time
/// @realtime set-up only
class Dynamic {
 public:
  /// Loads the service `name` from `schema`, a text without includes, for example from
  /// schema_text(). The text may come from another program: see compile_text().
  /// @errors nullptr and the reason in `error`: not a schema, or no such service
  [[nodiscard]] static std::unique_ptr<Dynamic> make(const std::string& schema,
                                                     std::string_view name, std::string& error);
  /// Loads all of `schema`: its model's payloads can be converted.
  /// @errors nullptr and the reason in `error`: not a schema
  [[nodiscard]] static std::unique_ptr<Dynamic> make(const std::string& schema, std::string& error);
  /// Loads the event `name` from `schema`, for example from EventDescriptor::schema.
  /// @errors nullptr and the reason in `error`: not a schema, or no such event
  [[nodiscard]] static std::unique_ptr<Dynamic> make_for_event(const std::string& schema,
                                                               std::string_view name,
                                                               std::string& error);
  Dynamic(const Dynamic&) = delete;
  Dynamic& operator=(const Dynamic&) = delete;
  ~Dynamic();

  [[nodiscard]] const Model& model() const noexcept;
  /// The service; only valid after make() with its name.
  [[nodiscard]] const Service& service() const noexcept;
  /// The event's payload; only valid after make_for_event().
  [[nodiscard]] const Payload& event() const noexcept;
  /// The method with that name; nullptr if there is none.
  [[nodiscard]] const Method* find(std::string_view method) const noexcept;

  /// Encodes `json` for the wire.
  /// @errors nullopt and the reason in `error`: `json` does not match the schema, with line, column
  ///         and field; a struct lacks fields, which are named; a number is outside its
  ///         `rtpm_range`
  [[nodiscard]] std::optional<std::vector<std::byte>> encode(const Payload& payload,
                                                             std::string_view json,
                                                             std::string& error);
  /// Decodes `bytes` to strict JSON in one line, of at most 64 MiB.
  /// @errors nullopt: the bytes do not match, contain values without a name in the schema, or the
  ///         text would be longer
  [[nodiscard]] std::optional<std::string> decode(const Payload& payload,
                                                  std::span<const std::byte> bytes);
  /// Converts the payload to a FlatBuffer whose root is its table: a bare struct becomes the
  /// table's field.
  /// @errors nullopt: the bytes do not match
  [[nodiscard]] std::optional<std::vector<std::byte>> as_table(const Payload& payload,
                                                               std::span<const std::byte> bytes);
  /// The reverse of as_table(): the wire bytes for a FlatBuffer whose root is the payload's table.
  /// For an empty payload, `bytes` may also be empty.
  /// @errors nullopt: the bytes do not match
  [[nodiscard]] std::optional<std::vector<std::byte>> from_table(const Payload& payload,
                                                                 std::span<const std::byte> bytes);
  /// Why `bytes` are not a request or reply of this type, such as "force.x is 30, but must be -20 to
  /// 20"; empty if they are.
  [[nodiscard]] std::string refusal(const Payload& payload, std::span<const std::byte> bytes);
  /// The reflection(), reduced to the payload's table, which is the root, and its types.
  [[nodiscard]] std::vector<std::byte> reflection_of(const Payload& payload) const;
  /// The reflection() of the same bytes for viewers, reduced to a table, which is the root, and its
  /// types, without arrays: an array `joints` of a struct is fields `joints_0`, `joints_1` … at the
  /// same offsets. compile_binary() makes them arrays again.
  /// @param table  the name of one in model()
  [[nodiscard]] std::vector<std::byte> flat_reflection(std::string_view table) const;
  /// The schema as FlatBuffers' own reflection, the content of a .bfbs.
  [[nodiscard]] std::span<const std::byte> reflection() const noexcept;

 private:
  class Impl;
  explicit Dynamic(std::unique_ptr<Impl> impl) noexcept;
  [[nodiscard]] std::optional<std::string> print(const Payload& payload, const std::uint8_t* data);
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtpm::schema
