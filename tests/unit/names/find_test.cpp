#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "registry_fixture.hpp"
#include "rtpm/names/directory.hpp"
#include "rtpm/names/registration.hpp"
#include "rtpm/test/text.hpp"

// Properties over the wire: to a registry with a bind, and back by describe() and find().
namespace rtpm::names {
namespace {

using namespace std::chrono_literals;

constexpr const char* kUrl = "rtpm://127.0.0.1:4711/object";

class Find : public testing::Test {
 protected:
  ServedRegistry registry_{};
  rpc::Node node_{{.wait = {.strategy = rt::WaitStrategy::kBlock}}};
  Directory directory_{node_, registry_.url()};
};

TEST_F(Find, LocatesMistakesInPredicatesAndProperties) {
  const auto refused = directory_.find({.predicate = "force > 3 an is_free"});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().outcome, Outcome::kBadPredicate);
  ASSERT_TRUE(refused.error().text_error);
  EXPECT_EQ(refused.error().text_error->offset, 10u);
  const auto preference = directory_.find({.preference = "least force"});
  ASSERT_FALSE(preference);
  EXPECT_EQ(preference.error().outcome, Outcome::kBadPreference);
  const auto claim_of_bad = std::vector<Property>{{"not", true}};
  Claim claim{"lab/arm0", kUrl, "lab.Arm", {1, 1}, 2s};
  claim.properties = claim_of_bad;
  const auto bad = directory_.bind(claim);
  ASSERT_FALSE(bad);
  EXPECT_EQ(bad.error().outcome, Outcome::kBadProperty);
  test::expect_text(bad.error().text(), {"property 1 of the name 'lab/arm0'"});
}

TEST_F(Find, TruncatesAtTheLimitAndCountsAllMatches) {
  const std::vector<Property> large{{"a", std::string(256, 'x')}, {"b", std::string(256, 'y')}};
  for (int i = 0; i < 250; ++i) {
    const std::string name = "lab/arm" + std::to_string(i);
    Claim claim{name, kUrl, "lab.Arm", {1, 1}, 10s};
    claim.properties = large;
    ASSERT_TRUE(directory_.bind(claim)) << i;
  }
  const auto all = directory_.find({});
  ASSERT_TRUE(all) << all.error().text();
  EXPECT_EQ(all->entries.size(), 250u);
  const auto some = directory_.find({.limit = 3});
  ASSERT_TRUE(some);
  EXPECT_EQ(some->entries.size(), 3u);
  EXPECT_EQ(some->accepted_count, 250u);
}

TEST_F(Find, FollowsThePropertiesOfARegistration) {
  const auto registration =
      test::made(Registration::create(node_, registry_.url(), "lab/arm0", kUrl, "lab.Arm", 2s, {},
                                      Takeover::kRefused, {{"is_free", true}}));
  EXPECT_EQ(directory_.find({.predicate = "is_free"})->accepted_count, 1u);
  EXPECT_TRUE(directory_.resolve("lab/arm0")->properties.empty()) << "resolve stays small";
  ASSERT_TRUE(registration->set_properties({{"is_free", false}}));
  EXPECT_EQ(directory_.find({.predicate = "is_free"})->accepted_count, 0u);
  EXPECT_FALSE(registration->set_properties({{"is free", false}}));
  EXPECT_EQ(directory_.find({.predicate = "not is_free"})->accepted_count, 1u);
}

}  // namespace
}  // namespace rtpm::names
