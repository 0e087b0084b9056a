#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

namespace rtpm::schema {

/// The candidate most similar to `word`; empty if none is similar enough to be a misspelling.
[[nodiscard]] std::string most_similar(std::string_view word,
                                       std::span<const std::string_view> candidates);

/// The noun with its article: "a table", "an enum".
[[nodiscard]] std::string with_article(std::string_view noun);

/// The shortest text that parses to the same number; identical on every machine.
[[nodiscard]] std::string number_text(double value);

/// "0x00c0ffee".
[[nodiscard]] std::string hexadecimal(std::uint64_t value, std::size_t digits);

/// The hint for a struct where a table is required.
[[nodiscard]] std::string wrap_struct_hint(const std::string& type);

}  // namespace rtpm::schema
