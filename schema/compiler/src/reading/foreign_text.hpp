#pragma once

#include <cstddef>
#include <optional>

#include "rtpm/schema/diagnostic.hpp"
#include "rtpm/schema/source.hpp"

namespace rtpm::schema {

/// Limits of a schema that another program sent. They bound the time and the memory that reading it
/// takes.
struct ForeignLimits {
  static constexpr std::size_t kByteMax = 256 * 1024;
  static constexpr std::size_t kStatementMax = 2048;  ///< Types, services, namespaces, attributes.
  static constexpr std::size_t kMemberMax = 8192;     ///< Fields, enum values and methods in all.
  static constexpr std::size_t kEnumValueMax = 1024;  ///< Of one enum or union.
  static constexpr std::size_t kMethodMax = 512;      ///< Of all services.
  static constexpr std::size_t kNameSizeMax = 128;    ///< Bytes of one word.
  static constexpr std::size_t kNamePartMax = 16;     ///< Components of a dotted name.
  static constexpr std::size_t kAttributeMax = 32;    ///< Of one declaration.
};

/// Why FlatBuffers' parser must not see `source`, a schema that another program sent; nothing if it
/// may.
///
/// Accepts declarations of types and services, and nothing else that the parser would take:
/// no includes, no data, no other languages.
[[nodiscard]] std::optional<Diagnostic> refuse_foreign(const SourceFile& source);

}  // namespace rtpm::schema
