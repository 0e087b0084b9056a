#pragma once

#include <cstdint>
#include <optional>
#include <set>
#include <string>
#include <string_view>

#include "model/attributes.hpp"
#include "reading/outline.hpp"
#include "rtpm/schema/diagnostic.hpp"

namespace rtpm::schema {

/// The number that all of `text` is, in decimal digits; nothing if it is none or too large.
[[nodiscard]] std::optional<std::uint64_t> to_number(std::string_view text);

/// Reads the attributes of one declaration after the other and reports what is wrong with them.
class AttributeReader {
 public:
  AttributeReader(const SchemaText& text, Diagnostics& errors) : text_(text), errors_(errors) {}

  void report(Span span, std::string message, std::string hint) const {
    errors_.push_back({text_.locate(span), std::move(message), std::move(hint), std::nullopt});
  }

  /// A value that is well formed: of a number the number, of a choice its index, else 1.
  struct Value {
    std::uint64_t number = 0;
    std::string text{};
  };

  /// What `use` says, on `place`; nothing, and reported, if it is unknown, belongs elsewhere or has
  /// a value that it cannot have. Nothing, and no error, if it is an attribute of another tool.
  /// `owner` is the declaration in words: "field `x` of table `Pose`".
  [[nodiscard]] std::optional<Value> read(const AttributeUse& use, AttributePlace place,
                                          const std::string& owner) const;

  /// Whether `use` is the first one of its name in `seen`; reported if not.
  bool is_first(const AttributeUse& use, std::set<std::string>& seen) const;

  /// Reports an attribute of RTPM or FlatBuffers that says nothing where it stands.
  void report_no_effect(const AttributeUse& use, const std::string& owner,
                        const std::string& hint) const {
    report(use.at, "`" + use.name + "` has no effect on " + owner, hint);
  }
  /// Reports `use`'s value as one that it cannot have.
  void report_value(const AttributeUse& use, const std::string& hint) const;

 private:
  const SchemaText& text_;
  Diagnostics& errors_;
};

}  // namespace rtpm::schema
