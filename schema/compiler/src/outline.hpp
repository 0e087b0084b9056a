#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "rtpm/schema/source.hpp"
#include "tokens.hpp"

/// Where things stand in a schema's text. FlatBuffers' reflection has no positions, so they are
/// found in the words of the text. Only made of a text that FlatBuffers' parser took.
namespace rtpm::schema {

/// An attribute as written: `rtpm_id: 3`, or `required` without a value.
struct AttributeUse {
  std::string name{};
  Span at{};
  std::optional<std::string> value{};
  Span value_at{};
};

struct MethodOutline {
  std::string name{};
  Span at{};
  std::string request{};  ///< The type's name as written.
  Span request_at{};
  std::string reply{};
  Span reply_at{};
  std::vector<AttributeUse> attributes{};
};

struct ServiceOutline {
  std::string name{};  ///< Fully qualified, with dots.
  Span at{};
  std::vector<AttributeUse> attributes{};
  std::vector<MethodOutline> methods{};
};

/// A table, struct, enum or union.
struct TypeOutline {
  std::string kind{};  ///< As in the text: "table".
  std::string name{};  ///< Fully qualified, with dots.
  Span at{};
};

/// An attribute on anything but a service or a method.
struct OtherAttribute {
  std::string owner{};  ///< In words: "table `Pose`", "field `x` of table `Pose`".
  AttributeUse use{};
};

struct Outline {
  std::vector<ServiceOutline> services{};
  std::vector<TypeOutline> types{};
  std::vector<OtherAttribute> other_attributes{};
  std::vector<Token> namespaces{};  ///< Each name of each namespace statement.
};

/// Ownership: the tokens in the result view `source`.
[[nodiscard]] Outline outline(const SourceFile& source);

}  // namespace rtpm::schema
