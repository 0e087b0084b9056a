#include "rtpm/events/wishes.hpp"

#include <algorithm>
#include <iterator>
#include <tuple>

#include "rtpm/events/link.hpp"
#include "rtpm/events/program.hpp"

namespace rtpm::events {
namespace {

using Kind = Filter::Kind;
constexpr Match kEverything{};

void append(std::vector<Match>& to, const std::vector<Match>& from) {
  to.insert(to.end(), from.begin(), from.end());
}

bool is_exact(const Match& match) noexcept {
  return match.type_mask == kWholeNumber && match.source_mask == kWholeNumber;
}

// Whether `wide` accepts all that `narrow` does.
bool covers(const Match& wide, const Match& narrow) noexcept {
  return wide.hops_min <= narrow.hops_min && (wide.type_mask & ~narrow.type_mask) == 0 &&
         (wide.source_mask & ~narrow.source_mask) == 0 &&
         ((wide.type ^ narrow.type) & wide.type_mask) == 0 &&
         ((wide.source ^ narrow.source) & wide.source_mask) == 0;
}

// Once each, the bits that no mask looks at being 0.
void sort_out(std::vector<Match>& wishes) {
  for (Match& each : wishes) {
    each.type &= each.type_mask;
    each.source &= each.source_mask;
  }
  const auto key = [](const Match& each) {
    return std::tuple(each.type, each.source, each.type_mask, each.source_mask, each.hops_min);
  };
  std::ranges::sort(wishes, {}, key);
  // Not std::ranges::unique: Clang 14 does not take what GCC's library gives back.
  wishes.erase(std::unique(wishes.begin(), wishes.end()), wishes.end());
  // What is exact covers at most its own kind, with more hops, which stands right behind it.
  std::vector<Match> wide;
  std::ranges::remove_copy_if(wishes, std::back_inserter(wide), is_exact);
  const auto is_covered = [&](const Match& each) {
    return std::ranges::any_of(
        wide, [&](const Match& other) { return other != each && covers(other, each); });
  };
  std::erase_if(wishes, is_covered);
  const auto is_twin = [](const Match& a, const Match& b) { return is_exact(a) && covers(a, b); };
  wishes.erase(std::unique(wishes.begin(), wishes.end(), is_twin), wishes.end());
}

// How much a list lets through, roughly: for the choice between children of "all".
std::size_t width_of(const std::vector<Match>& wishes) {
  std::size_t width = wishes.size();
  for (const Match& each : wishes)
    width += each.type_mask == kWholeNumber ? 0 : kMatchCountMax;
  return width;
}

bool keeps(const Filter& filter) {
  return filter.kind == Kind::kCorrelate || std::ranges::any_of(filter.children, keeps);
}

}  // namespace

std::vector<Match> wishes_of(const Filter& filter) {
  std::vector<Match> wishes;
  switch (filter.kind) {
    case Kind::kNull:
    case Kind::kNot:
      return {kEverything};
    case Kind::kMatch:
      return {{filter.type, filter.type_mask, filter.source, filter.source_mask}};
    case Kind::kListed:
      return filter.matches;
    case Kind::kWhere:
      return {{.type = filter.type, .type_mask = kWholeNumber}};
    case Kind::kOnce:
    case Kind::kEvery:
    case Kind::kSilence:
      return {};
    case Kind::kAny:
    case Kind::kCorrelate:
      for (const Filter& child : filter.children)
        append(wishes, wishes_of(child));
      return wishes;
    case Kind::kAll:
      break;
  }
  // A conjunction in it sees also the events that the others don't want.
  const bool keeps_some = std::ranges::any_of(filter.children, keeps);
  for (const Filter& child : filter.children) {
    std::vector<Match> its = wishes_of(child);
    if (keeps_some) {
      append(wishes, its);
    } else if (wishes.empty() || width_of(its) < width_of(wishes)) {
      wishes = std::move(its);
    }
  }
  return wishes;
}

std::vector<Match> unite(std::vector<Match> wishes) {
  // ev-5.2-2: where hubs are linked in a ring, a wish that nobody has any more dies out by its
  // hops.
  std::erase_if(wishes, [](const Match& each) { return each.hops_min >= kLinkHopsMax; });
  for (Match& each : wishes)
    ++each.hops_min;
  sort_out(wishes);
  if (wishes.size() <= kMatchCountMax) return wishes;
  for (Match& each : wishes)
    each.source_mask = 0;
  sort_out(wishes);
  if (wishes.size() <= kMatchCountMax) return wishes;
  return {{.hops_min = std::ranges::min_element(wishes, {}, &Match::hops_min)->hops_min}};
}

}  // namespace rtpm::events
