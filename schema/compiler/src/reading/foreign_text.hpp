#pragma once

#include <cstddef>
#include <optional>

#include "rtpm/schema/diagnostic.hpp"
#include "rtpm/schema/source.hpp"

namespace rtpm::schema {

/// Limits of a schema that another program sent. They bound the time and memory for reading it.
struct ForeignLimits {
  static constexpr std::size_t kByteMax = 256 * 1024;
  static constexpr std::size_t kStatementMax = 2048;  ///< Types, services, namespaces, attributes.
  static constexpr std::size_t kMemberMax = 8192;     ///< Fields, enum values and methods in total.
  static constexpr std::size_t kEnumValueMax = 1024;  ///< Values of one enum or union.
  static constexpr std::size_t kMethodMax = 512;      ///< Methods of all services.
  static constexpr std::size_t kNameSizeMax = 128;    ///< Bytes in one word.
  static constexpr std::size_t kNamePartMax = 16;     ///< Components of a dotted name.
  static constexpr std::size_t kAttributeMax = 32;    ///< Attributes of one declaration.
};

/// Why `source`, a schema that another program sent, must not reach FlatBuffers' parser; nullopt if
/// it may.
///
/// Accepts only declarations of types and services, although the parser would accept more: no
/// includes, no data, no other languages.
[[nodiscard]] std::optional<Diagnostic> refuse_foreign(const SourceFile& source);

}  // namespace rtpm::schema
