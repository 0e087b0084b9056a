#include "attributes.hpp"

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <vector>

#include "words.hpp"

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

/// The attribute, RTPM's or FlatBuffers', that somebody who wrote `name` most likely meant.
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

std::string value_hint(std::string_view name) {
  const KnownAttribute* known = find_attribute(name);
  if (known == nullptr) return {};
  if (known->max == 0) return "write `" + std::string(name) + "` alone, or leave it out";
  return "write `" + std::string(name) + ": N` with a whole number from 1 to " +
         std::to_string(known->max) + " in decimal digits";
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
