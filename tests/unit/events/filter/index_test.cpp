#include <gtest/gtest.h>

#include <map>
#include <random>
#include <set>

#include "filter/index.hpp"

namespace rtpm::events {
namespace {

std::multiset<std::uint32_t> found(const SubscriptionIndex& index, EventType type,
                                   SourceId source) {
  std::multiset<std::uint32_t> numbers;
  index.visit(type, source, [&](std::uint32_t number, bool, bool) { numbers.insert(number); });
  return numbers;
}

TEST(Index, RefusesInterestsAboveItsCapacityAsAWhole) {
  SubscriptionIndex index(2);
  ASSERT_TRUE(index.add(1, std::array{Interest{5, 2}}, true));
  EXPECT_FALSE(index.add(2, std::array{Interest{6, 2}, Interest{7, 2}}, true));
  EXPECT_TRUE(found(index, 6, 2).empty());
  EXPECT_TRUE(index.add(2, std::array{Interest{6, 2}}, true));
}

// After any sequence of additions and removals, the index finds what a plain search finds.
TEST(Index, FindsWhatAPlainSearchFinds) {
  std::mt19937 random(7);
  SubscriptionIndex index(600);
  std::map<std::uint32_t, std::vector<Interest>> truth;
  const auto number = [&](std::uint32_t below) {
    return static_cast<std::uint32_t>(random() % below);
  };
  for (int step = 0; step < 20'000; ++step) {
    const std::uint32_t subscription = number(300);
    if (const auto known = truth.find(subscription); known != truth.end()) {
      index.remove(subscription, known->second);
      truth.erase(known);
    } else {
      std::vector<Interest> interests{{number(20), number(4)}};
      if (number(3) == 0) interests[0].source.reset();
      if (number(3) == 0) interests.push_back({100 + number(20), std::nullopt});
      if (number(8) == 0) interests = {{std::nullopt, number(4)}};
      ASSERT_TRUE(index.add(subscription, interests, false));
      truth.emplace(subscription, interests);
    }
    if (step % 100 != 0) continue;
    const std::uint32_t type = number(2) * 100 + number(20);
    const std::uint32_t source = number(4);
    std::multiset<std::uint32_t> expected;
    for (const auto& [each, interests] : truth) {
      for (const Interest& interest : interests) {
        if (interest.type.value_or(type) == type && interest.source.value_or(source) == source) {
          expected.insert(each);
        }
      }
    }
    ASSERT_EQ(found(index, type, source), expected);
  }
}

}  // namespace
}  // namespace rtpm::events
