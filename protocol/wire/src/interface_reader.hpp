#pragma once

#include <optional>
#include <string_view>
#include <unordered_map>
#include <vector>

/// The parsed text of an interface (spec/hprotocol.md#hp-12.2). All views are into the text.
namespace rtpm::wire {

struct MethodText {
  std::string_view id{};
  std::string_view name{};
  bool is_idempotent = false;
  std::string_view manner{};   ///< "oneway sent", "stream" or empty.
  std::string_view request{};  ///< "struct lab.ForceMessage"
  std::string_view reply{};

  [[nodiscard]] std::string_view request_table() const noexcept;
  [[nodiscard]] std::string_view reply_table() const noexcept;
};

/// A table, struct, enumeration or union.
struct TypeText {
  std::string_view head{};  ///< "struct lab.Force size 16 align 8"
  std::string_view kind{};
  std::string_view name{};
  std::vector<std::string_view> members{};  ///< Its lines, without the indentation of two spaces.
};

struct InterfaceText {
  std::string_view name{};
  std::vector<MethodText> methods{};
  std::unordered_map<std::string_view, TypeText> types{};
};

struct FieldText {
  std::string_view id{};
  std::string_view name{};
  std::string_view type{};       ///< "vector<object>"
  std::string_view type_name{};  ///< Such as "lab.Force"; empty if none.
  bool is_required = false;
  bool is_optional = false;
  bool is_deprecated = false;
  std::string_view default_value{};  ///< A number's default; otherwise empty.
  bool is_key = false;
  std::string_view encodings{};  ///< The attributes that change the meaning of bytes.
  std::string_view unit{};
  std::string_view frame{};

  [[nodiscard]] bool needs_value() const noexcept { return is_required && !is_deprecated; }
};

struct ValueText {
  std::string_view name{};
  std::string_view number{};
  std::string_view type{};       ///< The type of a union member: "object lab.Force".
  std::string_view type_name{};  ///< Such as "lab.Force"; empty if none.
};

/// Parses an interface text; nullopt if it is malformed.
[[nodiscard]] std::optional<InterfaceText> read_interface(std::string_view text);
[[nodiscard]] std::optional<FieldText> read_field(std::string_view line) noexcept;
[[nodiscard]] std::optional<ValueText> read_value(std::string_view line) noexcept;
/// The number before a field.
[[nodiscard]] std::string_view id_of(std::string_view field) noexcept;

}  // namespace rtpm::wire
