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

/// Converts requests and replies of one service, or the payload of one event, to and from JSON, for
/// tools without generated code.
///
/// The JSON is an object of the table's fields or, for a payload that is a bare struct, of the
/// struct's: `{x: 1, y: 2}`, also in its table's field: `{force: {x: 1, y: 2}}`. Names need no
/// quotation marks; absent fields of tables have their defaults, those of structs none. Printed,
/// null stands for numbers that JSON does not have.
/// @ownership holds all it needs
/// @threads  one at a time
/// @realtime set-up only
class Dynamic {
 public:
  /// For the service `name` of `schema`, a text without includes, such as schema_text() returns. It
  /// may be another program's: see compile_text().
  /// @errors nullptr and the reason in `error`: not a schema, or no such service
  [[nodiscard]] static std::unique_ptr<Dynamic> make(const std::string& schema,
                                                     std::string_view name, std::string& error);
  /// For the event `name` of `schema`, such as EventDescriptor::schema has.
  /// @errors nullptr and the reason in `error`: not a schema, or no such event
  [[nodiscard]] static std::unique_ptr<Dynamic> make_for_event(const std::string& schema,
                                                               std::string_view name,
                                                               std::string& error);
  Dynamic(const Dynamic&) = delete;
  Dynamic& operator=(const Dynamic&) = delete;
  ~Dynamic();

  [[nodiscard]] const Model& model() const noexcept;
  /// Of a service's.
  [[nodiscard]] const Service& service() const noexcept;
  /// Of an event's: what its payload is.
  [[nodiscard]] const Payload& event() const noexcept;
  /// nullptr if there is no such method.
  [[nodiscard]] const Method* find(std::string_view method) const noexcept;

  /// The bytes on the wire.
  /// @errors nothing and the reason in `error`: `json` does not match the schema, with its line,
  ///         column and field; a struct lacks fields, which are named; a number is outside its
  ///         `rtpm_range`
  [[nodiscard]] std::optional<std::vector<std::byte>> encode(const Payload& payload,
                                                             std::string_view json,
                                                             std::string& error);
  /// Strict JSON in one line, of at most 64 MiB.
  /// @errors nothing: the bytes do not match, have values that the schema has no name for, or give
  ///         a longer text
  [[nodiscard]] std::optional<std::string> decode(const Payload& payload,
                                                  std::span<const std::byte> bytes);
  /// The payload as a FlatBuffer whose root is its table: a bare struct becomes its field.
  /// @errors nothing: the bytes do not match
  [[nodiscard]] std::optional<std::vector<std::byte>> as_table(const Payload& payload,
                                                               std::span<const std::byte> bytes);
  /// What as_table() was given: the bytes on the wire of a FlatBuffer whose root is the table. Of a
  /// payload of nothing, also of no bytes.
  /// @errors nothing: the bytes do not match
  [[nodiscard]] std::optional<std::vector<std::byte>> from_table(const Payload& payload,
                                                                 std::span<const std::byte> bytes);
  /// As reflection(), of the payload's table and what it contains only, with the table as root.
  [[nodiscard]] std::vector<std::byte> reflection_of(const Payload& payload) const;
  /// The schema as FlatBuffers' own reflection, the content of a .bfbs.
  [[nodiscard]] std::span<const std::byte> reflection() const noexcept;

 private:
  class Impl;
  explicit Dynamic(std::unique_ptr<Impl> impl) noexcept;
  [[nodiscard]] std::optional<std::string> print(const Payload& payload, const std::uint8_t* data);
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtpm::schema
