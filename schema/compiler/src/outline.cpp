#include "outline.hpp"

#include <tuple>
#include <utility>

namespace rtpm::schema {
namespace {

/// Walks the words of a schema and notes where declarations stand.
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
  /// Up to the next `what`, which is taken too, or to the end.
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
      if (token().is_identifier()) outline_.namespaces.push_back(token());
      next();
    }
    next();
  }

  /// A type's name, which may have dots.
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

  void note_attributes(const std::string& owner) {
    for (AttributeUse& use : read_attributes()) {
      outline_.other_attributes.push_back({owner, std::move(use)});
    }
  }

  /// `table` or `struct`, and what stands in its braces: `name : type = default (attributes);`.
  void read_object() {
    const std::string kind(token().text);
    next();
    const std::string name(token().text);
    outline_.types.push_back({kind, qualified(name), token().span()});
    next();
    const std::string owner = kind + " `" + name + "`";
    note_attributes(owner);
    take("{");
    while (token().kind != TokenKind::kEnd && !take("}")) {
      std::string field_of_owner = "field `";
      field_of_owner.append(token().text).append("` of ").append(owner);
      while (token().kind != TokenKind::kEnd && !token().is(";") && !token().is("("))
        next();
      note_attributes(field_of_owner);
      take(";");
    }
  }

  void read_enum() {
    const std::string kind(token().text);
    next();
    const std::string name(token().text);
    outline_.types.push_back({kind, qualified(name), token().span()});
    while (token().kind != TokenKind::kEnd && !token().is("(") && !token().is("{"))
      next();
    note_attributes(kind + " `" + name + "`");
    skip_past("}");
  }

  std::vector<Token> tokens_;
  std::size_t at_ = 0;
  std::string namespace_{};
  Outline outline_{};
};

}  // namespace

Outline outline(const SourceFile& source) {
  return OutlineReader(tokenize(source)).read();
}

}  // namespace rtpm::schema
