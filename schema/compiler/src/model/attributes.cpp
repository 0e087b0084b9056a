#include "model/attributes.hpp"

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <vector>

#include "model/words.hpp"

namespace rtpm::schema {
namespace {

constexpr std::string_view kFlatbuffersAttributes[] = {
    "deprecated",
    "required",
    "key",
    "shared",
    "hash",
    "id",
    "force_align",
    "bit_flags",
    "original_order",
    "nested_flatbuffer",
    "csharp_partial",
    "streaming",
    "idempotent",
    "cpp_type",
    "cpp_ptr_type",
    "cpp_ptr_type_get",
    "cpp_str_type",
    "cpp_str_flex_ctor",
    "native_inline",
    "native_custom_alloc",
    "native_type",
    "native_type_pack_name",
    "native_default",
    "flexbuffer",
    "private",
};

/// The most similar attribute of RTPM or FlatBuffers.
std::string similar_attribute(std::string_view name) {
  std::vector<std::string_view> names(std::begin(kFlatbuffersAttributes),
                                      std::end(kFlatbuffersAttributes));
  for (const KnownAttribute& known : kKnownAttributes)
    names.push_back(known.name);
  return most_similar(name, names);
}

}  // namespace

const KnownAttribute* find_attribute(std::string_view name) noexcept {
  const auto found =
      std::find_if(kKnownAttributes.begin(), kKnownAttributes.end(),
                   [name](const KnownAttribute& known) { return known.name == name; });
  return found == kKnownAttributes.end() ? nullptr : &*found;
}

std::string_view words_of(AttributePlace place) noexcept {
  switch (place) {
    case AttributePlace::kMethod:
      return "a method of an rpc_service";
    case AttributePlace::kService:
      return "an rpc_service";
    case AttributePlace::kTable:
      return "a table";
    case AttributePlace::kField:
      break;
  }
  return "a field of a table or struct";
}

std::string value_hint(std::string_view name) {
  const KnownAttribute* known = find_attribute(name);
  if (known == nullptr) return {};
  const std::string begin = "write `" + std::string(name);
  switch (known->value) {
    case AttributeValue::kNone:
      return begin + "` alone, or leave it out";
    case AttributeValue::kNumber:
      return begin + ": N` with a whole number from " + std::to_string(known->min) + " to " +
             std::to_string(known->max) + " in decimal digits";
    case AttributeValue::kText:
      return begin + ": \"...\"` with a text of at most 64 bytes, without `\"` and `\\` in it";
    case AttributeValue::kRange:
      return begin + ": \"low..high\"`, such as \"-20..20\", with numbers of the field's type";
    case AttributeValue::kChoice:
      break;
  }
  std::string words;
  for (const std::string_view choice : known->choices) {
    if (!choice.empty()) words += (words.empty() ? "\"" : ", \"") + std::string(choice) + '"';
  }
  return begin + ": WORD` with one of these words: " + words;
}

bool is_plain_text(std::string_view value) noexcept {
  return !value.empty() && value.size() <= 64 &&
         std::none_of(value.begin(), value.end(), [](char c) {
           return static_cast<unsigned char>(c) < ' ' || c == '\x7f' || c == '"' || c == '\\';
         });
}

bool is_flatbuffers_attribute(std::string_view name) noexcept {
  return std::find(std::begin(kFlatbuffersAttributes), std::end(kFlatbuffersAttributes), name) !=
         std::end(kFlatbuffersAttributes);
}

std::string unknown_attribute_hint(std::string_view name) {
  if (const std::string similar = similar_attribute(name); !similar.empty()) {
    return "did you mean `" + similar + "`?";
  }
  if (!name.starts_with("rtpm_")) {
    return "an attribute of a tool of yours must be declared: attribute \"" + std::string(name) +
           "\";";
  }
  std::string hint = "RTPM's attributes are";
  for (std::size_t i = 0; i < kKnownAttributes.size(); ++i) {
    const std::string_view separator = i == 0                            ? " "
                                       : i + 1 < kKnownAttributes.size() ? ", "
                                                                         : " and ";
    hint += std::string(separator) + std::string(kKnownAttributes[i].name);
  }
  return hint;
}

}  // namespace rtpm::schema
