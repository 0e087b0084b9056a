#include "filter/compiler.hpp"

#include <algorithm>
#include <bit>
#include <tuple>

#include "filter/operand.hpp"

namespace rtpm::events {
namespace {

using Kind = Filter::Kind;

std::string_view to_string(Kind kind) noexcept {
  switch (kind) {
    case Kind::kNull:
      return "everything";
    case Kind::kMatch:
      return "match";
    case Kind::kAny:
      return "any";
    case Kind::kAll:
      return "all";
    case Kind::kNot:
      return "not";
    case Kind::kCorrelate:
      return "correlate";
    case Kind::kWhere:
      return "where";
    case Kind::kOnce:
      return "once";
    case Kind::kEvery:
      return "every";
    case Kind::kListed:
      return "listed";
    case Kind::kSilence:
      break;
  }
  return "silence";
}

unexpected<SetupError> refuse(const std::string& path, const std::string& why) {
  return setup_error("Filter node " + path + " is refused", why);
}

bool is_group(Kind kind) noexcept {
  return kind == Kind::kAny || kind == Kind::kAll || kind == Kind::kNot || kind == Kind::kCorrelate;
}

bool covers(const Interest& wide, const Interest& narrow) {
  return (!wide.type || wide.type == narrow.type) && (!wide.source || wide.source == narrow.source);
}

// Adds interests that are not covered yet, and removes those that the new ones cover.
void add_once(std::vector<Interest>& to, const std::vector<Interest>& from) {
  for (const Interest& each : from) {
    if (std::ranges::any_of(to, [&](const Interest& other) { return covers(other, each); })) {
      continue;
    }
    std::erase_if(to, [&](const Interest& other) { return covers(each, other); });
    to.push_back(each);
  }
}

Interest interest_of(const Match& match) {
  Interest interest;
  if (match.type_mask == kWholeNumber) interest.type = match.type;
  if (match.source_mask == kWholeNumber) interest.source = match.source;
  return interest;
}

bool is_decided_by_interest(const Match& match) {
  const auto is_all_or_nothing = [](std::uint32_t mask) {
    return mask == 0 || mask == kWholeNumber;
  };
  return is_all_or_nothing(match.type_mask) && is_all_or_nothing(match.source_mask) &&
         match.hops_min == 0;
}

// How is_listed() looks up a match.
enum class MatchKind : std::uint8_t { kExact, kOfType, kMasked };

MatchKind kind_of(const Match& match) {
  if (match.type_mask != kWholeNumber) return MatchKind::kMasked;
  if (match.source_mask == kWholeNumber) return MatchKind::kExact;
  return match.source_mask == 0 ? MatchKind::kOfType : MatchKind::kMasked;
}

// Like add_once(), but for long lists.
std::vector<Interest> interests_in(const std::vector<Match>& matches) {
  std::vector<Interest> all;
  all.reserve(matches.size());
  for (const Match& each : matches)
    all.push_back(interest_of(each));
  const auto key = [](const Interest& each) { return std::tuple(each.type, each.source); };
  std::ranges::sort(all, {}, key);
  const auto has = [&](const Interest& wanted) {
    return std::ranges::binary_search(all, key(wanted), {}, key);
  };
  if (has({})) return {{}};
  std::vector<Interest> interests;
  for (const Interest& each : all) {
    const bool is_exact = each.type && each.source;
    const bool is_covered = is_exact && (has({.type = each.type}) || has({.source = each.source}));
    if (!is_covered && (interests.empty() || interests.back() != each)) interests.push_back(each);
  }
  return interests;
}

bool wants_any_type(const std::vector<Interest>& interests) {
  return std::ranges::any_of(interests, [](const Interest& each) { return !each.type; });
}

std::uint64_t bits_of(const Scalar& scalar) noexcept {
  switch (scalar.kind) {
    case Scalar::Kind::kSigned:
      return static_cast<std::uint64_t>(scalar.integer);
    case Scalar::Kind::kUnsigned:
      return scalar.natural;
    case Scalar::Kind::kReal:
      break;
  }
  return std::bit_cast<std::uint64_t>(scalar.real);
}

// Whether a sibling comparison implies this child of "all".
bool is_implied(const Filter& child, const std::vector<Filter>& siblings) {
  return child.kind == Kind::kMatch && child.type_mask == kWholeNumber && child.source_mask == 0 &&
         std::ranges::any_of(siblings, [&](const Filter& sibling) {
           return sibling.kind == Kind::kWhere && sibling.type == child.type;
         });
}

std::string in_words(Duration span) {
  return std::to_string(span.count()) + " ns";
}

}  // namespace

std::string in_words(EventType type, const EventDescriptor* descriptor) {
  std::string text = "event type " + std::to_string(type);
  if (descriptor != nullptr) text += " (" + std::string(descriptor->name) + ")";
  return text;
}

expected<const FieldDescriptor*, SetupError> find_field(EventType type, std::string_view name,
                                                        const DescriptorSource& types) {
  const EventDescriptor* descriptor = types.find(type);
  if (descriptor == nullptr) {
    return setup_error("no program has registered the fields of " + in_words(type, nullptr) +
                       ", so '" + std::string(name) + "' is unknown");
  }
  const auto found = std::ranges::find(descriptor->fields, name, &FieldDescriptor::name);
  if (found == descriptor->fields.end()) {
    return setup_error(in_words(type, descriptor) + " has no number '" + std::string(name) + "'");
  }
  return &*found;
}

expected<CompiledFilter, SetupError> Compiler::compile(const Filter& filter) {
  auto root = make(filter, std::string(to_string(filter.kind)), 1);
  if (!root) return unexpected{std::move(root.error())};
  for (const std::size_t timer : root->silences)
    compiled_.timers_[timer].group = root->index;
  compiled_.interests_ = std::move(root->interests);
  compiled_.is_decided_by_interest_ = root->is_decided_by_interest;
  compiled_.is_stateless_ = compiled_.timers_.empty() && compiled_.kept_.empty();
  return std::move(compiled_);
}

Compiler::Result Compiler::make(const Filter& filter, const std::string& path, std::size_t depth) {
  if (depth > kFilterDepthMax) {
    return refuse(path, "a filter is at most " + std::to_string(kFilterDepthMax) + " deep");
  }
  if (!is_group(filter.kind) && !filter.children.empty()) {
    return refuse(path, "it takes no children");
  }
  Children children;
  std::size_t number = 0;
  for (const Filter& child : filter.children) {
    if (filter.kind == Kind::kAll && is_implied(child, filter.children)) {
      ++number;
      continue;
    }
    const std::string child_path =
        path + "[" + std::to_string(number++) + "]." + std::string(to_string(child.kind));
    auto made = make(child, child_path, depth + 1);
    if (!made) return made;
    children.push_back(std::move(*made));
  }
  // "All" with a single child is that child.
  if (filter.kind == Kind::kAll && children.size() == 1 && !children[0].has_timeout) {
    return std::move(children[0]);
  }
  if (compiled_.nodes_.size() >= kFilterNodeCountMax) {
    return refuse(path, "a filter has at most " + std::to_string(kFilterNodeCountMax) + " nodes");
  }
  switch (filter.kind) {
    case Kind::kNull:
      return Made{.index = add({}), .interests = {{}}, .is_decided_by_interest = true};
    case Kind::kMatch:
      return make_match(filter);
    case Kind::kListed:
      return make_listed(filter, path);
    case Kind::kWhere:
      return make_where(filter, path);
    case Kind::kOnce:
    case Kind::kEvery:
    case Kind::kSilence:
      return make_timeout(filter, path);
    default:
      return make_group(filter, path, children);
  }
}

std::size_t Compiler::add(const CompiledFilter::Node& node) {
  compiled_.nodes_.push_back(node);
  return compiled_.nodes_.size() - 1;
}

Compiler::Result Compiler::make_match(const Filter& filter) {
  Made made;
  made.index = add({.kind = Kind::kMatch,
                    .type = filter.type,
                    .type_mask = filter.type_mask,
                    .source = filter.source,
                    .source_mask = filter.source_mask});
  const Match match{filter.type, filter.type_mask, filter.source, filter.source_mask};
  made.interests = {interest_of(match)};
  made.is_decided_by_interest = is_decided_by_interest(match);
  return made;
}

// Sorted for binary search: matches with type and source, then matches with a type only. Masked
// ones are scanned.
Compiler::Result Compiler::make_listed(const Filter& filter, const std::string& path) {
  if (filter.matches.size() > kMatchCountMax) {
    return refuse(path, "a list has at most " + std::to_string(kMatchCountMax) + " matches");
  }
  std::vector<Match> matches = filter.matches;
  std::ranges::sort(matches, {}, [](const Match& each) {
    return std::tuple(kind_of(each), each.type, each.source, each.type_mask, each.source_mask,
                      each.hops_min);
  });
  // Among matches that differ only in hops, the first one has the fewest and covers the others.
  // Avoids std::ranges::unique, because Clang 14 rejects libstdc++'s.
  const auto all_but_hops = [](const Match& each) {
    return std::tuple(each.type, each.type_mask, each.source, each.source_mask);
  };
  matches.erase(std::unique(matches.begin(), matches.end(),
                            [&](const Match& one, const Match& other) {
                              return all_but_hops(one) == all_but_hops(other);
                            }),
                matches.end());
  Made made;
  made.interests = interests_in(matches);
  made.is_decided_by_interest = std::ranges::all_of(matches, is_decided_by_interest);
  const auto count_of = [&](MatchKind kind) {
    return static_cast<std::uint32_t>(std::ranges::count(matches, kind, kind_of));
  };
  CompiledFilter::Node node{.kind = Kind::kListed};
  node.match_begin = static_cast<std::uint32_t>(compiled_.matches_.size());
  node.type_begin = node.match_begin + count_of(MatchKind::kExact);
  node.mask_begin = node.type_begin + count_of(MatchKind::kOfType);
  node.match_end = node.mask_begin + count_of(MatchKind::kMasked);
  compiled_.matches_.insert(compiled_.matches_.end(), matches.begin(), matches.end());
  made.index = add(node);
  return made;
}

Compiler::Result Compiler::make_where(const Filter& filter, const std::string& path) {
  const auto field = find_field(filter.type, filter.field, types_);
  if (!field) return refuse(path, field.error().reason());
  const auto operand = operand_for((*field)->type, filter.comparison, filter.operand);
  const EventDescriptor* descriptor = types_.find(filter.type);
  if (!operand) {
    return refuse(path, "'" + filter.field + "' of " + in_words(filter.type, descriptor) + ": " +
                            operand.error().reason());
  }
  CompiledFilter::Node node{.kind = Kind::kWhere};
  node.comparison = filter.comparison;
  node.field_type = (*field)->type;
  node.type = filter.type;
  node.path = (*field)->path;
  node.schema_id = descriptor->schema_id;
  node.operand_bits = bits_of(*operand);
  // Converted to the field's kind.
  const auto default_value =
      operand_for((*field)->type, Comparison::kEqual, (*field)->default_value);
  node.default_bits = default_value ? bits_of(*default_value) : 0;
  return Made{.index = add(node), .interests = {{.type = filter.type}}};
}

Compiler::Result Compiler::make_timeout(const Filter& filter, const std::string& path) {
  if (filter.span < kTimeoutMin || filter.span > kTimeoutMax) {
    return refuse(path, "its time of " + in_words(filter.span) + " is not between " +
                            in_words(kTimeoutMin) + " and " + in_words(kTimeoutMax));
  }
  Made made;
  made.index = add({.kind = filter.kind});
  made.has_timeout = true;
  if (filter.kind == Kind::kSilence) made.silences.push_back(compiled_.timers_.size());
  compiled_.timers_.push_back({.kind = filter.kind,
                               .node = made.index,
                               .group = made.index,
                               .span = filter.span,
                               .tag = filter.tag});
  return made;
}

Compiler::Result Compiler::make_group(const Filter& filter, const std::string& path,
                                      const Children& children) {
  if (children.empty()) return refuse(path, "it has no children");
  if (filter.kind == Kind::kNot && children.size() != 1) {
    return refuse(path, "it takes exactly one child");
  }
  if (filter.kind == Kind::kCorrelate && filter.span < Duration{0}) {
    return refuse(path, "a skew is not negative");
  }
  Made made;
  CompiledFilter::Node node{.kind = filter.kind};
  std::size_t sum = 0;
  std::size_t largest = 0;
  made.keeps = filter.kind == Kind::kCorrelate;
  for (const Made& child : children) {
    node.children |= std::uint64_t{1} << child.index;
    sum += child.group_size;
    largest = std::max(largest, child.group_size);
    made.keeps |= child.keeps;
    made.has_timeout |= child.has_timeout;
  }
  const bool is_all_or_not = filter.kind == Kind::kAll || filter.kind == Kind::kNot;
  if (is_all_or_not && made.has_timeout) {
    return refuse(path, "a timeout in it never meets an event; put it beside the group");
  }
  made.group_size = filter.kind == Kind::kAny ? largest : filter.kind == Kind::kNot ? 1 : sum;
  if (made.group_size > kGroupSizeMax) {
    return refuse(path,
                  "it may deliver more than " + std::to_string(kGroupSizeMax) + " events together");
  }
  made.interests = interests_of(filter, children);
  if (made.interests.size() > kInterestCountMax) {
    return refuse(path,
                  "it names more than " + std::to_string(kInterestCountMax) + " types and sources");
  }
  made.is_decided_by_interest =
      filter.kind == Kind::kAny && std::ranges::all_of(children, &Made::is_decided_by_interest);
  if (filter.kind == Kind::kCorrelate) {
    node.skew_ns = filter.span.count();
    keep_for(node, children);
  }
  made.index = add(node);
  for (const Made& child : children) {
    for (const std::size_t timer : child.silences)
      compiled_.timers_[timer].group = made.index;
  }
  return made;
}

// The events that a group must see: for "all", those of its most selective child, unless it
// contains a conjunction; for "not", all events.
std::vector<Interest> Compiler::interests_of(const Filter& filter, const Children& children) {
  if (filter.kind == Kind::kNot) return {{}};
  const bool keeps = std::ranges::any_of(children, &Made::keeps);
  if (filter.kind == Kind::kAll && !keeps) {
    const auto cost = [](const Made& child) {
      return child.interests.size() + (wants_any_type(child.interests) ? kInterestCountMax : 0);
    };
    return std::ranges::min_element(children, {}, cost)->interests;
  }
  std::vector<Interest> interests;
  for (const Made& child : children)
    add_once(interests, child.interests);
  return interests;
}

void Compiler::keep_for(CompiledFilter::Node& node, const Children& children) {
  node.kept_begin = static_cast<std::uint32_t>(compiled_.kept_.size());
  for (const Made& child : children) {
    CompiledFilter::Kept kept;
    kept.child = static_cast<std::uint32_t>(child.index);
    compiled_.kept_.push_back(std::move(kept));
  }
}

expected<CompiledFilter, SetupError> CompiledFilter::compile(const Filter& filter,
                                                             const DescriptorSource& types) {
  return Compiler(types).compile(filter);
}

}  // namespace rtpm::events
