#include <algorithm>
#include <array>
#include <charconv>
#include <string>

#include "rtpm/events/filter_text.hpp"
#include "rtpm/options/duration.hpp"
#include "rtpm/predicate/comparison.hpp"

namespace rtpm::events {
namespace {

using Kind = Filter::Kind;

/// Binding strength of a text; a weaker one is put in parentheses.
enum class Strength : int { kCorrelation, kAny, kAll, kNot, kPrimary };

struct Text {
  std::string text;
  Strength strength = Strength::kPrimary;
};

std::string within(const Text& inner, Strength needed) {
  return inner.strength < needed ? "(" + inner.text + ")" : inner.text;
}

std::string hex(std::uint32_t number) {
  std::array<char, 8> digits{};
  const auto end = std::to_chars(digits.begin(), digits.end(), number, 16).ptr;
  return "0x" + std::string(digits.data(), end);
}

std::string text_of(const Scalar& scalar) {
  if (scalar.kind == Scalar::Kind::kSigned) return std::to_string(scalar.integer);
  if (scalar.kind == Scalar::Kind::kUnsigned) return std::to_string(scalar.natural);
  std::array<char, 40> digits{};  // The shortest that reads as the same number.
  const auto end = std::to_chars(digits.begin(), digits.end(), scalar.real).ptr;
  std::string text(digits.data(), end);
  if (text.find_first_of(".e") == std::string::npos) text += ".0";
  return text;
}

class Printer {
 public:
  explicit Printer(std::span<const EventDescriptor* const> types) noexcept : types_(types) {}

  [[nodiscard]] Text text_of_filter(const Filter& filter) const {
    switch (filter.kind) {
      case Kind::kNull:
        return {"all"};
      case Kind::kMatch:
        return match(filter);
      case Kind::kAny:
        return joined(filter, " or ", Strength::kAny);
      case Kind::kAll:
        return joined(filter, " and ", Strength::kAll);
      case Kind::kNot:
        return {"not " + within(text_of_filter(filter.children.front()), Strength::kNot),
                Strength::kNot};
      case Kind::kCorrelate:
        return correlation(filter);
      case Kind::kWhere:
        return {type_text(filter.type, kWholeNumber) + ":" + filter.field + " " +
                std::string(predicate::symbol_of(filter.comparison)) + " " +
                text_of(filter.operand)};
      case Kind::kOnce:
        return timeout("once", filter);
      case Kind::kEvery:
        return timeout("every", filter);
      case Kind::kSilence:
        return timeout("silence", filter);
      case Kind::kListed:
        return list(filter);
    }
    return {"all"};
  }

 private:
  [[nodiscard]] std::string type_text(EventType type, std::uint32_t mask) const {
    if (mask == 0) return "*";
    if (mask != kWholeNumber) return hex(type) + "/" + hex(mask);
    const auto known = std::ranges::find(types_, type, &EventDescriptor::type);
    return known == types_.end() ? std::to_string(type) : std::string((*known)->name);
  }
  [[nodiscard]] static std::string source_text(SourceId source, std::uint32_t mask) {
    if (mask == 0) return "*";
    return mask == kWholeNumber ? std::to_string(source) : hex(source) + "/" + hex(mask);
  }

  [[nodiscard]] Text match(const Filter& filter) const {
    const std::string type = "type(" + type_text(filter.type, filter.type_mask) + ")";
    if (filter.source_mask == 0) return {type};
    const std::string source = "source(" + source_text(filter.source, filter.source_mask) + ")";
    if (filter.type_mask == 0) return {source};
    return {type + " and " + source, Strength::kAll};
  }

  [[nodiscard]] Text list(const Filter& filter) const {
    std::string text;
    for (const Match& match : filter.matches) {
      text += (text.empty() ? "" : ", ") + type_text(match.type, match.type_mask) + ":" +
              source_text(match.source, match.source_mask);
      if (match.hops_min > 0) text += ":" + std::to_string(match.hops_min);
    }
    return {"listed(" + text + ")"};
  }

  [[nodiscard]] Text joined(const Filter& filter, const char* word, Strength strength) const {
    // Equally strong texts need parentheses, too: "a and (b and c)" is another tree than "a and b
    // and c".
    const auto needed = static_cast<Strength>(static_cast<int>(strength) + 1);
    std::string text;
    for (const Filter& child : filter.children)
      text += (text.empty() ? "" : word) + within(text_of_filter(child), needed);
    return {text, filter.children.size() == 1 ? Strength::kPrimary : strength};
  }

  [[nodiscard]] Text correlation(const Filter& filter) const {
    std::string text;
    for (std::size_t i = 0; i < filter.children.size(); ++i) {
      if (i == 1) {
        text += filter.span == Duration{0}
                    ? " with "
                    : " within " + options::duration_text(filter.span) + " of ";
      }
      if (i > 1) text += ", ";
      text += within(text_of_filter(filter.children[i]), Strength::kAny);
    }
    return {text, Strength::kCorrelation};
  }

  [[nodiscard]] static Text timeout(const char* name, const Filter& filter) {
    const std::string tag = filter.tag == 0 ? "" : ", " + std::to_string(filter.tag);
    return {std::string(name) + "(" + options::duration_text(filter.span) + tag + ")"};
  }

  std::span<const EventDescriptor* const> types_;
};

}  // namespace

std::string to_text(const Filter& filter, std::span<const EventDescriptor* const> types) {
  return Printer(types).text_of_filter(filter).text;
}

}  // namespace rtpm::events
