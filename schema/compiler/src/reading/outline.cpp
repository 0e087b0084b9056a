#include "reading/outline.hpp"

#include <tuple>
#include <utility>

#include "model/attributes.hpp"

namespace rtpm::schema {
namespace {

class OutlineReader {
 public:
  explicit OutlineReader(std::vector<Token> tokens) : tokens_(std::move(tokens)) {}

  Outline read() {
    while (token().kind != TokenKind::kEnd) {
      if (token().is("namespace")) {
        read_namespace();
      } else if (token().is("rpc_service")) {
        read_service();
      } else if (token().is("table") || token().is("struct")) {
        read_object();
      } else if (token().is("enum") || token().is("union")) {
        read_enum();
      } else {
        skip_statement();
      }
    }
    return std::move(outline_);
  }

 private:
  [[nodiscard]] const Token& token() const { return tokens_[at_]; }
  void next() {
    if (token().kind != TokenKind::kEnd) ++at_;
  }
  bool take(std::string_view what) {
    if (!token().is(what)) return false;
    next();
    return true;
  }
  /// Skips everything up to and including the next `what`, if any.
  void skip_past(std::string_view what) {
    while (token().kind != TokenKind::kEnd && !token().is(what))
      next();
    next();
  }
  void skip_statement() { skip_past(";"); }

  [[nodiscard]] std::string qualified(std::string_view name) const {
    return namespace_.empty() ? std::string(name) : namespace_ + '.' + std::string(name);
  }

  void read_namespace() {
    next();
    namespace_.clear();
    while (token().kind != TokenKind::kEnd && !token().is(";")) {
      namespace_ += token().text;
      if (token().is_identifier()) {
        outline_.namespaces.push_back({std::string(token().text), token().span()});
      }
      next();
    }
    next();
  }

  /// Reads a type name, which may contain dots.
  std::pair<std::string, Span> read_type_name() {
    std::string name;
    const std::size_t begin = token().offset;
    std::size_t end = begin;
    while (token().is_identifier() || token().is(".")) {
      name += token().text;
      end = token().end();
      next();
    }
    return {std::move(name), Span{begin, end - begin}};
  }

  std::vector<AttributeUse> read_attributes() {
    std::vector<AttributeUse> uses;
    if (!take("(")) return uses;
    while (token().kind != TokenKind::kEnd && !token().is(")")) {
      AttributeUse use{.name = std::string(token().value()), .at = token().span()};
      next();
      if (take(":")) {
        const std::size_t begin = token().offset;
        std::size_t end = begin;
        use.value = token().value();
        while (token().kind != TokenKind::kEnd && !token().is(",") && !token().is(")")) {
          end = token().end();
          next();
        }
        use.value_at = {begin, end - begin};
      }
      uses.push_back(std::move(use));
      take(",");
    }
    next();
    return uses;
  }

  void read_service() {
    next();
    ServiceOutline service{.name = qualified(token().text), .at = token().span()};
    next();
    service.attributes = read_attributes();
    take("{");
    while (token().kind != TokenKind::kEnd && !take("}")) {
      MethodOutline method{.name = std::string(token().text), .at = token().span()};
      next();
      take("(");
      std::tie(method.request, method.request_at) = read_type_name();
      take(")");
      take(":");
      std::tie(method.reply, method.reply_at) = read_type_name();
      method.attributes = read_attributes();
      skip_statement();
      service.methods.push_back(std::move(method));
    }
    outline_.services.push_back(std::move(service));
  }

  TypeOutline read_type_head() {
    TypeOutline type{.kind = std::string(token().text)};
    next();
    type.name = qualified(token().text);
    type.at = token().span();
    next();
    return type;
  }

  /// Reads `table` or `struct`, with fields `name : type = default (attributes);`.
  void read_object() {
    TypeOutline type = read_type_head();
    type.attributes = read_attributes();
    take("{");
    while (token().kind != TokenKind::kEnd && !take("}")) {
      MemberOutline field{.name = std::string(token().text), .at = token().span()};
      while (token().kind != TokenKind::kEnd && !token().is(";") && !token().is("("))
        next();
      field.attributes = read_attributes();
      take(";");
      type.members.push_back(std::move(field));
    }
    outline_.types.push_back(std::move(type));
  }

  /// Reads `enum` or `union`: `Name : type (attributes) { value = 1, alias:Type, lab.Type }`.
  void read_enum() {
    TypeOutline type = read_type_head();
    while (token().kind != TokenKind::kEnd && !token().is("(") && !token().is("{"))
      next();
    type.attributes = read_attributes();
    take("{");
    while (token().kind != TokenKind::kEnd && !take("}")) {
      MemberOutline value;
      std::tie(value.name, value.at) = read_type_name();
      while (token().kind != TokenKind::kEnd && !token().is(",") && !token().is("}"))
        next();
      take(",");
      type.members.push_back(std::move(value));
    }
    outline_.types.push_back(std::move(type));
  }

  std::vector<Token> tokens_;
  std::size_t at_ = 0;
  std::string namespace_{};
  Outline outline_{};
};

/// Converts attributes from the reflection, which has "0" for an attribute without a value.
std::vector<AttributeUse> uses_of(const std::vector<Attribute>& attributes) {
  std::vector<AttributeUse> uses;
  for (const Attribute& attribute : attributes) {
    const KnownAttribute* known = find_attribute(attribute.name);
    AttributeUse use{.name = attribute.name};
    if (attribute.value != "0" || (known && known->value == AttributeValue::kNumber)) {
      use.value = attribute.value;
    }
    uses.push_back(std::move(use));
  }
  return uses;
}

}  // namespace

Outline outline(const SourceFile& source) {
  return OutlineReader(tokenize(source)).read();
}

Outline outline(const Model& model) {
  Outline result;
  for (const Service& service : model.services) {
    ServiceOutline text{.name = service.name, .attributes = uses_of(service.attributes)};
    for (const Method& method : service.methods) {
      text.methods.push_back({.name = method.name,
                              .request = model.objects[method.request.table].name,
                              .reply = model.objects[method.reply.table].name,
                              .attributes = uses_of(method.attributes)});
    }
    result.services.push_back(std::move(text));
  }
  for (const Object& object : model.objects) {
    TypeOutline text{.kind = object.is_struct ? "struct" : "table",
                     .name = object.name,
                     .attributes = uses_of(object.attributes)};
    for (const Field& field : object.fields) {
      text.members.push_back({.name = field.name, .attributes = uses_of(field.attributes)});
    }
    result.types.push_back(std::move(text));
  }
  return result;
}

}  // namespace rtpm::schema
