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

/// Parses all of `text` as a decimal number; nullopt if it is not a number, or too large.
[[nodiscard]] std::optional<std::uint64_t> to_number(std::string_view text);

/// Reads attributes and reports invalid ones.
class AttributeReader {
 public:
  AttributeReader(const SchemaText& text, Diagnostics& errors) : text_(text), errors_(errors) {}

  void report(Span span, std::string message, std::string hint) const {
    errors_.push_back({text_.locate(span), std::move(message), std::move(hint), std::nullopt});
  }

  /// `number` is the value of a number or the index of a choice; otherwise 1.
  struct Value {
    std::uint64_t number = 0;
    std::string text{};
  };

  /// The value of `use` on a declaration of kind `place`; nullopt for other tools' attributes.
  /// @param owner  the declaration in words: "field `x` of table `Pose`"
  /// @errors       nullopt, and reported: unknown, misplaced, or with an invalid value
  [[nodiscard]] std::optional<Value> read(const AttributeUse& use, AttributePlace place,
                                          const std::string& owner) const;

  /// Whether `use` is the first with its name in `seen`; reports it if not.
  bool is_first(const AttributeUse& use, std::set<std::string>& seen) const;

  /// Reports an attribute that has no effect on `owner`.
  void report_no_effect(const AttributeUse& use, const std::string& owner,
                        const std::string& hint) const {
    report(use.at, "`" + use.name + "` has no effect on " + owner, hint);
  }
  /// Reports an invalid value.
  void report_value(const AttributeUse& use, const std::string& hint) const;

 private:
  const SchemaText& text_;
  Diagnostics& errors_;
};

}  // namespace rtpm::schema
