#include "attributes.hpp"

#include <algorithm>
#include <cstddef>
#include <vector>

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

/// Letters to add, remove or change to make one word of the other (Levenshtein's distance).
std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j)
    row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t change = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({change, row[j] + 1, row[j - 1] + 1});
    }
  }
  return row[b.size()];
}

}  // namespace

bool is_known_attribute(std::string_view name) noexcept {
  return std::any_of(kKnownAttributes.begin(), kKnownAttributes.end(),
                     [name](const KnownAttribute& known) { return known.name == name; });
}

bool is_flatbuffers_attribute(std::string_view name) noexcept {
  return std::find(std::begin(kFlatbuffersAttributes), std::end(kFlatbuffersAttributes), name) !=
         std::end(kFlatbuffersAttributes);
}

std::string_view similar_attribute(std::string_view name) {
  // A third of the letters wrong is the most that still looks like a slip of the finger.
  std::size_t best = name.size() / 3 + 1;
  std::string_view found;
  const auto consider = [&](std::string_view candidate) {
    const std::size_t distance = edit_distance(name, candidate);
    if (distance == 0 || distance >= best) return;
    best = distance;
    found = candidate;
  };
  for (const KnownAttribute& known : kKnownAttributes)
    consider(known.name);
  for (const std::string_view candidate : kFlatbuffersAttributes)
    consider(candidate);
  return found;
}

std::string unknown_attribute_hint(std::string_view name) {
  if (const std::string_view similar = similar_attribute(name); !similar.empty()) {
    return "did you mean `" + std::string(similar) + "`?";
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
