#include "rtpm/predicate/comparison.hpp"

#include <algorithm>
#include <array>

namespace rtpm::predicate {
namespace {

constexpr std::array<std::string_view, 7> kSymbols{"==", "!=", "<", "<=", ">", ">=", "&"};

}  // namespace

std::optional<Comparison> comparison_of(std::string_view symbol) noexcept {
  const auto* const found = std::ranges::find(kSymbols, symbol);
  if (found == kSymbols.end()) return std::nullopt;
  return static_cast<Comparison>(found - kSymbols.begin());
}

std::string_view symbol_of(Comparison comparison) noexcept {
  return kSymbols[static_cast<std::size_t>(comparison)];
}

}  // namespace rtpm::predicate
