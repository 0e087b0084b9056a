#pragma once

#include <span>
#include <string>
#include <string_view>

namespace rtpm::schema {

/// The one of `candidates` that somebody who wrote `word` most likely meant; empty if none looks
/// like it.
[[nodiscard]] std::string most_similar(std::string_view word,
                                       std::span<const std::string_view> candidates);

/// "a table", "an enum".
[[nodiscard]] std::string with_article(std::string_view noun);

/// The shortest text that reads back as the same number, on every machine.
[[nodiscard]] std::string number_text(double value);

/// The hint for a struct that stands where a table must.
[[nodiscard]] std::string wrap_struct_hint(const std::string& type);

}  // namespace rtpm::schema
