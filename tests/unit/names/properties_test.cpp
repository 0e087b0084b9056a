#include "model/properties.hpp"
#include "store/store.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <limits>
#include <string>
#include <vector>

#include "model/query.hpp"

// Properties of bindings: the refused ones, and their sizes with respect to the limits.
namespace rtpm::names {
namespace {

using namespace std::chrono_literals;

constexpr Owner kArm{.id = 1, .epoch = 10};
constexpr Owner kStranger{.id = 2, .epoch = 1};
constexpr MonotonicTime kNow{1s};

Claim claim(std::string_view name, std::span<const Property> properties, Owner owner = kArm) {
  Claim claimed{name, "rtpm://10.0.0.1:4711/object", "lab.Arm", owner, 2s};
  claimed.properties = properties;
  return claimed;
}

Outcome outcome_of(Store& store, const Claim& claimed) {
  const auto bound = store.bind(claimed, kNow);
  return bound ? Outcome::kDone : bound.error().outcome;
}

Property text_of_size(const std::string& name, std::size_t size) {
  return {name, std::string(size, 'x')};
}

TEST(Properties, AreRefusedByNumberWhereMalformed) {
  const double infinite = std::numeric_limits<double>::infinity();
  const std::vector<Property> bad{
      {"", true},
      {"2nd", true},
      {"a b", true},
      {"url", std::string("rtpm://h:1/p")},
      {"and", true},
      {std::string(kPropertyNameSizeMax + 1, 'n'), true},
      {"a", infinite},
      {"a", std::numeric_limits<double>::quiet_NaN()},
      text_of_size("a", kPropertyTextSizeMax + 1),
      {"a", std::string("\x1b[2J")},
      {"a", std::string("\xff")},
      {"a", 1.0, std::string(kPropertyUnitSizeMax + 1, 'u')},
      {"a", 1.0, "\n"},
      {"a", PropertyList{PropertyType::kReal, {1.0, infinite}}},
      {"a", PropertyList{PropertyType::kReal, {1.0, std::string("x")}}},
      {"a", PropertyList{PropertyType::kBool,
                         std::vector<predicate::Item>(kPropertyListSizeMax + 1, true)}}};
  for (std::size_t i = 0; i < bad.size(); ++i) {
    Store store;
    const std::vector<Property> properties{{"good", true}, bad[i]};
    const auto refused = store.bind(claim("lab/arm0", properties), kNow);
    ASSERT_FALSE(refused) << i;
    EXPECT_EQ(refused.error().outcome, Outcome::kBadProperty) << i;
    EXPECT_EQ(refused.error().component, 1) << i;
    EXPECT_EQ(store.size(), 0u);
  }
  EXPECT_EQ(first_bad_property(std::vector<Property>{{"a", true}, {"b", true}, {"a", 1.0}}), 2u);
  std::vector<Property> many;
  for (std::size_t i = 0; i <= kPropertyCountMax; ++i)
    many.push_back({"p" + std::to_string(i), true});
  EXPECT_EQ(first_bad_property(many), kPropertyCountMax);
  many.pop_back();
  EXPECT_FALSE(first_bad_property(many));
}

TEST(Properties, AreBoundedPerBindingPerOwnerAndInAll) {
  Store store({.property_byte_max = 250,
               .property_byte_per_owner_max = 400,
               .property_byte_in_all_max = 600});
  const std::vector<Property> large{text_of_size("a", 240)};
  const std::vector<Property> medium{text_of_size("a", 191)};  // 200 bytes
  const std::vector<Property> small{text_of_size("a", 1)};     // 10 bytes
  ASSERT_EQ(byte_count(medium), 200u);
  EXPECT_EQ(outcome_of(store, claim("a", std::vector<Property>{text_of_size("a", 250)})),
            Outcome::kBadProperty);
  EXPECT_EQ(outcome_of(store, claim("a", medium)), Outcome::kDone);
  EXPECT_EQ(outcome_of(store, claim("b", medium)), Outcome::kDone);
  EXPECT_EQ(outcome_of(store, claim("c", small)), Outcome::kOwnerPropertiesFull);
  EXPECT_EQ(outcome_of(store, claim("c", {})), Outcome::kDone);
  EXPECT_EQ(outcome_of(store, claim("a", large)), Outcome::kOwnerPropertiesFull);
  EXPECT_EQ(outcome_of(store, claim("a", medium)), Outcome::kDone) << "no more than before";
  EXPECT_EQ(outcome_of(store, claim("d", medium, kStranger)), Outcome::kDone);
  EXPECT_EQ(outcome_of(store, claim("e", small, kStranger)), Outcome::kPropertiesFull);
  // A removed name frees capacity.
  ASSERT_TRUE(store.unbind("b", kArm, kNow));
  EXPECT_EQ(outcome_of(store, claim("e", small, kStranger)), Outcome::kDone);
  EXPECT_EQ(outcome_of(store, claim("f", medium)), Outcome::kPropertiesFull);
  EXPECT_EQ(outcome_of(store, claim("a", small)), Outcome::kDone);
  EXPECT_EQ(outcome_of(store, claim("f", medium)), Outcome::kDone);
}

// ---- finding -------------------------------------------------------------------------------

class Query : public testing::Test {
 protected:
  Query() {
    bind("lab/arm0", "lab.Arm", {{"force", 3.0, "newton"}, {"is_free", true}});
    bind("lab/arm1", "lab.Arm", {{"force", 8.0, "newton"}, {"is_free", false}});
    bind("lab/arm2", "lab.Arm", {{"force", 5.0, "newton"}, {"is_free", true}});
    bind("lab/arm3", "lab.Arm", {});
    bind("lab/eye", "lab.Gaze", {{"force", std::string("none")}});
  }
  void bind(std::string_view name, std::string_view interface, std::vector<Property> properties) {
    Claim claimed = claim(name, properties);
    claimed.interface = interface;
    EXPECT_TRUE(store_.bind(claimed, kNow)) << name;
  }
  std::vector<std::string> found(const QueryTexts& texts, std::size_t count_max = 100) {
    const auto result = find(store_.index(kNow), texts, count_max, 1);
    EXPECT_TRUE(result) << result.error().error.what;
    std::vector<std::string> names;
    if (result) {
      for (const Record* record : result->records)
        names.push_back(record->name);
    }
    return names;
  }
  using Names = std::vector<std::string>;

  Store store_;
};

TEST_F(Query, FindsByInterfacePropertiesAndBuiltInOnes) {
  EXPECT_EQ(found({"lab.Arm", "force >= 4"}), (Names{"lab/arm1", "lab/arm2"}));
  EXPECT_EQ(found({"lab.Arm", "force >= 4 and is_free"}), Names{"lab/arm2"});
  EXPECT_EQ(found({"lab.Arm", ""}), (Names{"lab/arm0", "lab/arm1", "lab/arm2", "lab/arm3"}));
  EXPECT_EQ(found({"lab.Arm", "not exists force"}), Names{"lab/arm3"});
  EXPECT_EQ(found({"lab.Arm", "host == '10.0.0.1' and '2' ~ name"}), Names{"lab/arm2"});
  EXPECT_EQ(found({"", "interface == 'lab.Gaze'"}), Names{"lab/eye"});
  EXPECT_EQ(found({"lab.None", ""}), Names{});
  EXPECT_EQ(found({"lab.Arm", "", "max force"}, 2), (Names{"lab/arm1", "lab/arm2"}));
  EXPECT_EQ(find(store_.index(kNow), {"lab.Arm", "", "max force"}, 2, 1)->accepted_count, 4u);
}

TEST_F(Query, ChecksTypesByTheNamesOfTheInterface) {
  const auto refused = find(store_.index(kNow), {"lab.Arm", "force == 'none'"}, 9, 1);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().outcome, Outcome::kBadPredicate);
  EXPECT_EQ(refused.error().error.offset, 9u);
  const auto preference = find(store_.index(kNow), {"lab.Arm", "", "max is_free"}, 9, 1);
  ASSERT_FALSE(preference);
  EXPECT_EQ(preference.error().outcome, Outcome::kBadPreference);
  // Across interfaces the types differ: the predicate is compared with each name as it is.
  EXPECT_EQ(found({"", "force == 'none'"}), Names{"lab/eye"});
  EXPECT_EQ(found({"", "force > 7"}), Names{"lab/arm1"});
  // The types disappear with the names.
  for (const char* const name : {"lab/arm0", "lab/arm1", "lab/arm2"})
    ASSERT_TRUE(store_.unbind(name, kArm, kNow));
  EXPECT_EQ(found({"lab.Arm", "force == 'none'"}), Names{});
}

TEST_F(Query, SuggestsTheNameOfAnUnknownProperty) {
  const auto result = find(store_.index(kNow), {"lab.Arm", "forces > 3 or is_free"}, 9, 1);
  ASSERT_TRUE(result);
  EXPECT_EQ(result->records.size(), 2u);
  EXPECT_EQ(result->note, "no name of lab.Arm has the property 'forces' (did you mean 'force'?)");
  EXPECT_EQ(find(store_.index(kNow), {"lab.Arm", "name == 'x'"}, 9, 1)->note, "");
}

}  // namespace
}  // namespace rtpm::names
