#include "link/interest_set.hpp"

#include <algorithm>
#include <iterator>
#include <tuple>

#include "filter/compiled_filter.hpp"
#include "rtpm/events/link.hpp"

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

// Whether `wide` accepts everything that `narrow` accepts.
bool covers(const Match& wide, const Match& narrow) noexcept {
  return wide.hops_min <= narrow.hops_min && (wide.type_mask & ~narrow.type_mask) == 0 &&
         (wide.source_mask & ~narrow.source_mask) == 0 &&
         ((wide.type ^ narrow.type) & wide.type_mask) == 0 &&
         ((wide.source ^ narrow.source) & wide.source_mask) == 0;
}

// Clears unmasked bits, and removes duplicates and covered entries.
void sort_out(std::vector<Match>& interest) {
  for (Match& each : interest) {
    each.type &= each.type_mask;
    each.source &= each.source_mask;
  }
  const auto key = [](const Match& each) {
    return std::tuple(each.type, each.source, each.type_mask, each.source_mask, each.hops_min);
  };
  std::ranges::sort(interest, {}, key);
  // Not std::ranges::unique: Clang 14 rejects libstdc++'s.
  interest.erase(std::unique(interest.begin(), interest.end()), interest.end());
  // An exact entry only covers the same entry with more hops, which follows it.
  std::vector<Match> wide;
  std::ranges::remove_copy_if(interest, std::back_inserter(wide), is_exact);
  const auto is_covered = [&](const Match& each) {
    return std::ranges::any_of(
        wide, [&](const Match& other) { return other != each && covers(other, each); });
  };
  std::erase_if(interest, is_covered);
  const auto is_twin = [](const Match& a, const Match& b) { return is_exact(a) && covers(a, b); };
  interest.erase(std::unique(interest.begin(), interest.end(), is_twin), interest.end());
}

// Estimates how much a list accepts, to choose between children of "all".
std::size_t width_of(const std::vector<Match>& interest) {
  std::size_t width = interest.size();
  for (const Match& each : interest)
    width += each.type_mask == kWholeNumber ? 0 : kMatchCountMax;
  return width;
}

bool keeps(const Filter& filter) {
  return filter.kind == Kind::kCorrelate || std::ranges::any_of(filter.children, keeps);
}

}  // namespace

std::vector<Match> interest_set_of(const Filter& filter) {
  std::vector<Match> interest;
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
        append(interest, interest_set_of(child));
      return interest;
    case Kind::kAll:
      break;
  }
  // A conjunction also sees events that its siblings reject.
  const bool keeps_some = std::ranges::any_of(filter.children, keeps);
  for (const Filter& child : filter.children) {
    std::vector<Match> its = interest_set_of(child);
    if (keeps_some) {
      append(interest, its);
    } else if (interest.empty() || width_of(its) < width_of(interest)) {
      interest = std::move(its);
    }
  }
  return interest;
}

std::vector<Match> unite_interest(std::vector<Match> interest) {
  // ev-5.2-2: if hubs are linked in a ring, interest that no subscription has any more expires by
  // its hop count.
  std::erase_if(interest, [](const Match& each) { return each.hops_min >= kLinkHopsMax; });
  for (Match& each : interest)
    ++each.hops_min;
  sort_out(interest);
  if (interest.size() <= kMatchCountMax) return interest;
  for (Match& each : interest)
    each.source_mask = 0;
  sort_out(interest);
  if (interest.size() <= kMatchCountMax) return interest;
  return {{.hops_min = std::ranges::min_element(interest, {}, &Match::hops_min)->hops_min}};
}

}  // namespace rtpm::events
