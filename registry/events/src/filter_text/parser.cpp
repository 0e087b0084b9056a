#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include "filter/operand.hpp"
#include "rtpm/events/filter_text.hpp"
#include "rtpm/predicate/comparison.hpp"
#include "rtpm/predicate/number.hpp"
#include "rtpm/predicate/token_reader.hpp"
#include "rtpm/program/duration.hpp"
#include "rtpm/program/text.hpp"

namespace rtpm::events {
namespace {

using Kind = Filter::Kind;
using predicate::Token;

/// A number of a type or source with its mask; mask 0 means any.
struct Masked {
  std::uint32_t value = 0;
  std::uint32_t mask = 0;
};

std::optional<Scalar> parse_scalar(std::string_view text) {
  if (text == "true") return Scalar::of(true);
  if (text == "false") return Scalar::of(false);
  const auto number = predicate::parse_number(text);
  if (!number) return std::nullopt;
  return std::visit([](auto value) { return Scalar::of(value); }, *number);
}

/// A field whose type is not known yet: its position in the text, and its node's place in the tree.
bool is_unresolved(const Filter& filter) {
  return filter.kind == Kind::kWhere && filter.type == 0;
}

/// Recursive descent; after each function `token_` is the token after the parsed part.
class Parser : predicate::TokenReader {
 public:
  Parser(std::string_view text, std::span<const EventDescriptor* const> types)
      : TokenReader(text), types_(types) {}

  expected<Filter, FilterTextError> parse() {
    if (text().size() > kFilterTextSizeMax) {
      return unexpected{
          FilterTextError{kFilterTextSizeMax,
                          "a filter has at most " + std::to_string(kFilterTextSizeMax) + " bytes"}};
    }
    Filter filter = parse_correlation();
    if (!error_ && token_.kind != Token::Kind::kEnd) {
      fail(token_, "expected 'and', 'or', 'within', 'with' or the end, not " + shown(token_));
    }
    if (!error_) check_depth(filter, 1);
    if (!error_) resolve(filter, nullptr);
    if (error_) return unexpected{std::move(*error_)};
    return filter;
  }

 private:
  Filter made(Filter filter, const Token& at) {
    if (++node_count_ > kFilterNodeCountMax) {
      fail(at, "a filter has at most " + std::to_string(kFilterNodeCountMax) + " parts");
    }
    return filter;
  }

  // ---- operators, from weak to strong ------------------------------------------------------

  /// A within 5ms of B, C · A with B, C
  Filter parse_correlation() {
    const Token begin = token_;
    Filter first = parse_any();
    Duration skew{0};
    if (take("within")) {
      skew = parse_time(Duration{1}, Duration::max());
      require("of");
    } else if (!take("with")) {
      return first;
    }
    std::vector<Filter> children;
    children.push_back(std::move(first));
    do
      children.push_back(parse_any());
    while (take(","));
    if (children.size() > kGroupSizeMax) {
      fail(begin, "at most " + std::to_string(kGroupSizeMax) + " events are correlated");
    }
    return made(correlate(std::move(children), skew), begin);
  }

  Filter parse_any() {
    const Token begin = token_;
    std::vector<Filter> children;
    do
      children.push_back(parse_all());
    while (take_operator("or", "||"));
    if (children.size() == 1) return std::move(children.front());
    return made(any_of(std::move(children)), begin);
  }

  Filter parse_all() {
    const Token begin = token_;
    std::vector<Filter> children;
    do
      add_to_all(children, parse_not());
    while (take_operator("and", "&&"));
    if (children.size() == 1) return std::move(children.front());
    return made(all_of(std::move(children)), begin);
  }

  /// "type(T) and source(S)" is one node.
  void add_to_all(std::vector<Filter>& children, Filter child) {
    const bool is_source = child.kind == Kind::kMatch && child.type_mask == 0;
    if (is_source && !children.empty() && children.back().kind == Kind::kMatch &&
        children.back().source_mask == 0) {
      children.back().source = child.source;
      children.back().source_mask = child.source_mask;
      --node_count_;
      return;
    }
    children.push_back(std::move(child));
  }

  Filter parse_not() {
    const Token begin = token_;
    if (!take_not()) return parse_primary();
    return made(none_of(nested(begin, [this] { return parse_not(); })), begin);
  }

  // ---- primaries ---------------------------------------------------------------------------

  Filter parse_primary() {
    const Token begin = token_;
    if (take("(")) {
      Filter inner = nested(begin, [this] { return parse_correlation(); });
      require(")");
      return inner;
    }
    if (begin.kind == Token::Kind::kNumber) return parse_numbered_field(begin);
    if (begin.kind != Token::Kind::kWord) {
      fail(begin,
           "expected a condition, such as type(…), source(…) or a field, not " + shown(begin));
      return {};
    }
    advance();
    if (begin.text == "all" && !is_at("(")) return made(everything(), begin);
    if (is_at("(")) return made(parse_function(begin), begin);
    return parse_comparison(begin);
  }

  Filter parse_function(const Token& name) {
    require("(");
    Filter filter;
    if (name.text == "type") {
      filter = parse_types();
    } else if (name.text == "source") {
      filter = parse_sources();
    } else if (name.text == "listed") {
      filter = parse_listed();
    } else if (name.text == "once") {
      filter = parse_timeout(&once);
    } else if (name.text == "every") {
      filter = parse_timeout(&every);
    } else if (name.text == "silence") {
      filter = parse_timeout(&silence);
    } else {
      fail(name, "there is no condition " + shown(name) +
                     program::suggestion(name.text,
                                         {"type", "source", "listed", "once", "every", "silence"}));
    }
    require(")");
    return filter;
  }

  /// type(T) · type(T, U) · type(0x100/0xff00)
  Filter parse_types() {
    std::vector<Match> matches;
    do {
      const Masked type = parse_type();
      matches.push_back({.type = type.value, .type_mask = type.mask});
    } while (take(","));
    check_count(matches);
    if (matches.size() > 1) return listed(std::move(matches));
    return masked(matches.front().type, matches.front().type_mask, 0, 0);
  }

  Filter parse_sources() {
    std::vector<Match> matches;
    do {
      const Masked source = parse_masked("a source's number");
      matches.push_back({.source = source.value, .source_mask = source.mask});
    } while (take(","));
    check_count(matches);
    if (matches.size() > 1) return listed(std::move(matches));
    return masked(0, 0, matches.front().source, matches.front().source_mask);
  }

  /// listed(T:S, *:S:HOPS)
  Filter parse_listed() {
    std::vector<Match> matches;
    do {
      Match match;
      const Masked type = parse_type();
      match.type = type.value;
      match.type_mask = type.mask;
      require(":");
      const Masked source = parse_masked("a source's number");
      match.source = source.value;
      match.source_mask = source.mask;
      if (take(":")) match.hops_min = static_cast<std::uint8_t>(parse_number("hops", 255));
      matches.push_back(match);
    } while (take(","));
    check_count(matches);
    return listed(std::move(matches));
  }

  void check_count(const std::vector<Match>& matches) {
    if (matches.size() > kMatchCountMax) {
      fail(token_, "a list has at most " + std::to_string(kMatchCountMax) + " entries");
    }
  }

  Filter parse_timeout(Filter (*make)(Duration, std::uint32_t)) {
    const Duration time = parse_time(kTimeoutMin, kTimeoutMax);
    const auto tag =
        take(",") ? static_cast<std::uint32_t>(parse_number("the tag", UINT32_MAX)) : 0;
    return make(time, tag);
  }

  /// 7:FIELD > 2
  Filter parse_numbered_field(const Token& begin) {
    const auto type = static_cast<EventType>(parse_number("a type's number", UINT32_MAX));
    require(":");
    return parse_comparison_of(type, parse_field(), begin);
  }
  Token parse_field() {
    const Token field = token_;
    if (field.kind != Token::Kind::kWord) fail(field, "expected a field, not " + shown(field));
    advance();
    return field;
  }

  /// FIELD > 2 · TYPE:FIELD > 2
  Filter parse_comparison(const Token& name) {
    if (!take(":")) return parse_comparison_of(0, name, name);
    const EventType type = type_named(name);
    return parse_comparison_of(type, parse_field(), name);
  }
  Filter parse_comparison_of(EventType type, const Token& field, const Token& begin) {
    Filter filter = made({.kind = Kind::kWhere, .type = type}, begin);
    filter.field = std::string(field.text);
    const auto comparison = predicate::comparison_of(token_.text);
    if (!comparison) {
      fail(token_, is_at("=") ? "write '=='"
                              : "expected ==, !=, <, <=, >, >= or & behind " + shown(field) +
                                    ", not " + shown(token_));
      return filter;
    }
    filter.comparison = *comparison;
    advance();
    const Token operand = token_;
    const auto value = parse_scalar(operand.text);
    if (!value) {
      fail(operand, "expected a number, true or false, not " + shown(operand));
      return filter;
    }
    advance();
    filter.operand = *value;
    places_.push_back({field, operand});
    // Until its type is resolved, the tag identifies the node's place.
    filter.tag = static_cast<std::uint32_t>(places_.size() - 1);
    if (filter.type != 0) check_field(filter);
    return filter;
  }

  // ---- values ------------------------------------------------------------------------------

  EventType type_named(const Token& name) {
    for (const EventDescriptor* type : types_) {
      if (type->name == name.text) return type->type;
    }
    std::vector<std::string> names;
    for (const EventDescriptor* type : types_)
      names.emplace_back(type->name);
    fail(name,
         "no type is named " + shown(name) + program::suggestion(std::string(name.text), names));
    return 0;
  }

  Masked parse_type() {
    if (token_.kind != Token::Kind::kWord) return parse_masked("a type's name or number");
    const Token name = token_;
    advance();
    return {type_named(name), kWholeNumber};
  }

  /// * · 3 · 0x100/0xff00
  Masked parse_masked(const char* what) {
    if (take("*")) return {};
    Masked masked{static_cast<std::uint32_t>(parse_number(what, UINT32_MAX)), kWholeNumber};
    if (take("/")) masked.mask = static_cast<std::uint32_t>(parse_number("a mask", UINT32_MAX));
    return masked;
  }

  std::uint64_t parse_number(const char* what, std::uint64_t value_max) {
    const auto value = predicate::parse_natural(token_.text);
    if (token_.kind != Token::Kind::kNumber || !value) {
      fail(token_, "expected " + std::string(what) + ", not " + shown(token_));
      return 0;
    }
    if (*value > value_max) fail(token_, shown(token_) + " exceeds " + std::to_string(value_max));
    advance();
    return *value;
  }

  Duration parse_time(Duration low, Duration high) {
    const auto time = program::parse_duration(token_.text);
    if (token_.kind != Token::Kind::kNumber || !time) {
      fail(token_, "expected a time, such as 5ms, not " + shown(token_));
      return low;
    }
    if (*time < low || *time > high) {
      fail(token_,
           "the time must be " + program::duration_text(low) +
               (high == Duration::max() ? " at least" : " to " + program::duration_text(high)));
    }
    advance();
    return *time;
  }

  // ---- checks of the whole -----------------------------------------------------------------

  void check_depth(const Filter& filter, std::size_t depth) {
    if (depth > kFilterDepthMax) {
      fail({Token::Kind::kEnd, {}, 0},
           "a filter is nested at most " + std::to_string(kFilterDepthMax) + " deep");
      return;
    }
    for (const Filter& child : filter.children)
      check_depth(child, depth + 1);
  }

  /// The type stated by the conditions next to a field; 0 if none, or several types.
  static EventType stated_type(const std::vector<Filter>& conditions) {
    for (const Filter& condition : conditions) {
      const bool is_type = condition.kind == Kind::kMatch && condition.type_mask == kWholeNumber;
      if (is_type) return condition.type;
    }
    return 0;
  }

  /// Assigns each field the type that the nearest enclosing `and` states.
  void resolve(Filter& filter, const EventType* around) {
    EventType stated = 0;
    if (filter.kind == Kind::kAll) stated = stated_type(filter.children);
    if (stated != 0) around = &stated;
    if (is_unresolved(filter)) {
      if (around == nullptr) {
        const Token& field = places_[filter.tag].field;
        fail(field, "no type says what " + shown(field) + " is; write 'type(NAME) and " +
                        std::string(field.text) + " …', or 'NAME:" + std::string(field.text) +
                        " …'");
        return;
      }
      filter.type = *around;
      check_field(filter);
    }
    if (filter.kind == Kind::kWhere) filter.tag = 0;
    for (Filter& child : filter.children)
      resolve(child, around);
  }

  void check_field(Filter& filter) {
    const Place& place = places_[filter.tag];
    const auto type = std::ranges::find(types_, filter.type, &EventDescriptor::type);
    if (type == types_.end()) {
      fail(place.field, "the fields of type " + std::to_string(filter.type) + " are not known");
      return;
    }
    std::vector<std::string> names;
    for (const FieldDescriptor& field : (*type)->fields) {
      if (field.name == filter.field) return check_operand(filter, field, place);
      names.emplace_back(field.name);
    }
    fail(place.field, std::string((*type)->name) + " has no field " + shown(place.field) +
                          program::suggestion(filter.field, names));
  }

  struct Place {
    Token field{};
    Token operand{};
  };

  void check_operand(Filter& filter, const FieldDescriptor& field, const Place& place) {
    const auto fitting = operand_for(field.type, filter.comparison, filter.operand);
    if (!fitting) fail(place.operand, fitting.error().reason());
  }

  std::span<const EventDescriptor* const> types_;
  std::vector<Place> places_{};
  std::size_t node_count_ = 0;
};

}  // namespace

expected<Filter, FilterTextError> parse_filter(std::string_view text,
                                               std::span<const EventDescriptor* const> types) {
  return Parser(text, types).parse();
}

}  // namespace rtpm::events
