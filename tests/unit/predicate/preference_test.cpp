#include "rtpm/predicate/preference.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "offer.hpp"

namespace rtpm::predicate {
namespace {

using Order = std::vector<std::size_t>;

class PreferenceTest : public testing::Test {
 protected:
  PreferenceTest() {
    add({{"cost", 3.0}, {"is_free", false}});
    add({{"cost", std::int64_t{1}}, {"is_free", true}});
    add({{"model", std::string("odd")}});
    add({{"cost", 2.5}, {"is_free", true}});
    add({{"cost", 3.0}});
  }
  void add(std::vector<Property> properties) {
    offers_.push_back(std::make_unique<Offer>(std::move(properties)));
    candidates_.push_back(offers_.back().get());
  }
  Order order(std::string_view text, std::uint64_t random = 1) {
    const auto preference = Preference::parse(text);
    EXPECT_TRUE(preference) << text << ": " << preference.error().what;
    return preference ? preference->order(candidates_, random) : Order{};
  }

  std::vector<std::unique_ptr<Offer>> offers_{};
  std::vector<const PropertySource*> candidates_{};
};

TEST_F(PreferenceTest, OrdersAsTheTradingServiceDoes) {
  const Order as_found{0, 1, 2, 3, 4};
  EXPECT_EQ(order(""), as_found);
  EXPECT_EQ(order("first"), as_found);
  EXPECT_EQ(order("min cost"), (Order{1, 3, 0, 4, 2})) << "undefined ones come last";
  EXPECT_EQ(order("max cost"), (Order{0, 4, 3, 1, 2})) << "equal ones keep their order";
  EXPECT_EQ(order("min -cost * 2"), (Order{0, 4, 3, 1, 2}));
  EXPECT_EQ(order("with is_free"), (Order{1, 3, 0, 2, 4}));
  EXPECT_EQ(order("with cost > 2.7 or is_free"), (Order{0, 1, 3, 4, 2}));
  EXPECT_EQ(order("max model"), (Order{2, 0, 1, 3, 4}));
}

TEST_F(PreferenceTest, DrawsEveryCandidateOnce) {
  Order first = order("random", 1);
  bool differs = false;
  for (std::uint64_t seed = 2; seed < 20; ++seed)
    differs = differs || order("random", seed) != first;
  EXPECT_TRUE(differs);
  std::ranges::sort(first);
  EXPECT_EQ(first, (Order{0, 1, 2, 3, 4}));
}

TEST_F(PreferenceTest, RefusesMalformedPreferences) {
  struct Row {
    const char* text;
    std::size_t offset;
    const char* what;
  };
  const TypeOfProperty types = [](std::string_view name) {
    return name == "is_free" ? std::optional(Type::kBool)
           : name == "cost"  ? std::optional(Type::kReal)
                             : std::nullopt;
  };
  for (const Row& row :
       {Row{"mxa cost", 0, "did you mean 'max'"}, Row{"min", 3, "not the end"},
        Row{"first cost", 5, "nothing follows"}, Row{"max is_free", 4, "takes numbers or text"},
        Row{"with  cost", 6, "'with' takes bool"}, Row{"min cost +", 10, "not the end"},
        Row{"  max cost = 3", 11, "write '=='"}}) {
    const auto refused = Preference::parse(row.text, types);
    ASSERT_FALSE(refused) << row.text;
    EXPECT_EQ(refused.error().offset, row.offset) << row.text << refused.error().what;
    EXPECT_NE(refused.error().what.find(row.what), std::string::npos) << refused.error().what;
  }
}

}  // namespace
}  // namespace rtpm::predicate
