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

/// Requests and replies of one service as JSON, without generated code: for tools.
///
/// A request or reply is written as the table of the schema; where the table stands for one bare
/// struct, as that struct: `{x: 1, y: 2}`. Names need no quotation marks, and what is left out of a
/// table has its default.
/// Ownership: holds all it needs.   Threads: one at a time.   Set-up only.
class Dynamic {
 public:
  /// Of the service `name` in `schema`, a text that includes nothing, such as schema_text() gives.
  /// Nothing, and `error` says why, if the text is no schema or the service is not in it.
  [[nodiscard]] static std::unique_ptr<Dynamic> make(const std::string& schema,
                                                     std::string_view name, std::string& error);
  Dynamic(const Dynamic&) = delete;
  Dynamic& operator=(const Dynamic&) = delete;
  ~Dynamic();

  [[nodiscard]] const Model& model() const noexcept;
  [[nodiscard]] const Service& service() const noexcept;
  /// The method with this name; nullptr if there is none.
  [[nodiscard]] const Method* find(std::string_view method) const noexcept;

  /// The bytes of a payload on the wire; nothing, and `error` says why, if `json` is none.
  [[nodiscard]] std::optional<std::vector<std::byte>> encode(const Payload& payload,
                                                             std::string_view json,
                                                             std::string& error);
  /// The payload as strict JSON in one line; nothing if the bytes are none, or hold what this
  /// schema has no name for.
  [[nodiscard]] std::optional<std::string> decode(const Payload& payload,
                                                  std::span<const std::byte> bytes);

 private:
  class Impl;
  explicit Dynamic(std::unique_ptr<Impl> impl) noexcept;
  [[nodiscard]] std::optional<std::string> print(const Payload& payload, const std::uint8_t* data);
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtpm::schema
