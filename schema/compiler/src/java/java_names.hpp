#pragma once

#include <string>
#include <string_view>

#include "rtpm/schema/model.hpp"

/// The Java names of a schema's declarations.
namespace rtpm::schema::java {

/// Whether Java shows a field. Deprecated fields and the types of unions are hidden.
[[nodiscard]] bool is_shown(const Field& field) noexcept;
/// Whether Java has a class for a type. `rtpm.Empty` is no argument and null.
[[nodiscard]] bool is_shown(const Object& object) noexcept;

/// A name in UTF-16 with escapes that any encoding of sources understands.
[[nodiscard]] std::string ascii(std::string_view utf_8);
/// A string literal.
[[nodiscard]] std::string literal(std::string_view text);
/// A text of any size as an expression of text blocks at the beginning of lines.
[[nodiscard]] std::string text_block(const std::string& text);
/// A line of a comment: no tag, no end of the comment, no entity.
[[nodiscard]] std::string comment_text(std::string_view text);
/// `lines` as a comment of Javadoc, with paragraphs where lines are blank.
[[nodiscard]] std::string comment(const Documentation& lines, const std::string& indent);
/// As comment(), of lines that are escaped and may begin with tags.
[[nodiscard]] std::string tagged_comment(const Documentation& lines, const std::string& indent);

/// Names in the package of the compiled file and in others.
/// @ownership refers to the model, which must outlive it
class Names {
 public:
  explicit Names(const Model& model);

  /// "lab.arms" for a type of that namespace. Without a namespace, the name of the file that
  /// declares the type: Java cannot import what is in no package.
  [[nodiscard]] std::string package_of(const std::string& qualified_name,
                                       const std::string& declaration_file) const;
  /// The class of a type without its package. Names that generated code uses get a trailing
  /// underscore.
  [[nodiscard]] std::string type(const std::string& qualified_name) const;
  /// The whole name: "lab.Force".
  [[nodiscard]] std::string whole(const Object& object) const;
  [[nodiscard]] std::string whole(const Enum& enumeration) const;
  /// "xNewton" for "x_newton". Keywords, names that every object or generated class has, and first
  /// components of packages, which a member would hide, get a trailing underscore.
  [[nodiscard]] std::string member(std::string_view name) const;
  /// "GET_POSITION" for "get_position".
  [[nodiscard]] static std::string constant(std::string_view name);

 private:
  [[nodiscard]] bool begins_a_package(std::string_view name) const;

  const Model& model_;
};

}  // namespace rtpm::schema::java
