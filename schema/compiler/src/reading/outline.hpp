#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "reading/tokens.hpp"
#include "rtpm/schema/model.hpp"
#include "rtpm/schema/source.hpp"

/// Positions of declarations in a schema text, which FlatBuffers' reflection lacks. FlatBuffers'
/// parser must have accepted the text.
namespace rtpm::schema {

/// An attribute as written: `rtpm_id: 3`, or `required`.
struct AttributeUse {
  std::string name{};
  Span at{};
  std::optional<std::string> value{};
  Span value_at{};
};

struct MethodOutline {
  std::string name{};
  Span at{};
  std::string request{};  ///< The type's name, as written.
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

/// A field, or a value of an enum or union.
struct MemberOutline {
  std::string name{};
  Span at{};
  std::vector<AttributeUse> attributes{};
};

/// A table, struct, enum or union.
struct TypeOutline {
  std::string kind{};  ///< The keyword in the text: "table".
  std::string name{};  ///< Fully qualified, with dots.
  Span at{};
  std::vector<AttributeUse> attributes{};
  std::vector<MemberOutline> members{};
};

/// One component of a namespace statement.
struct NamespaceOutline {
  std::string name{};
  Span at{};
};

struct Outline {
  std::vector<ServiceOutline> services{};
  std::vector<TypeOutline> types{};
  std::vector<NamespaceOutline> namespaces{};
};

[[nodiscard]] Outline outline(const SourceFile& source);

/// The outline of a model without text; no part of it has a position.
[[nodiscard]] Outline outline(const Model& model);

/// A schema file's text and outline; for a .bfbs, which has no text, only name and outline.
class SchemaText {
 public:
  explicit SchemaText(SourceFile source)
      : path_(source.path()), source_(std::move(source)), outline_(schema::outline(*source_)) {}
  SchemaText(std::string path, const Model& model)
      : path_(std::move(path)), outline_(schema::outline(model)) {}

  [[nodiscard]] const schema::Outline& outline() const noexcept { return outline_; }
  [[nodiscard]] bool has_text() const noexcept { return source_.has_value(); }
  [[nodiscard]] Location locate(Span span) const {
    return source_ ? source_->locate(span) : Location{.file = path_};
  }

 private:
  std::string path_;
  std::optional<SourceFile> source_{};
  schema::Outline outline_;
};

}  // namespace rtpm::schema
