#include "rtpm/configuration/parameter_table.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "samples.hpp"

namespace rtpm::gvd {
namespace {

using driver::ParameterSetting;
using Settings = std::vector<ParameterSetting>;
using Names = std::vector<std::string>;

ParameterTable table() {
  return *ParameterTable::create(test::sample_specs(), 40);
}

void expect_refused(const Settings& settings, bool is_active, ConfigurationOutcome outcome,
                    const std::string& parameter) {
  const auto checked = table().check(settings, is_active);
  ASSERT_FALSE(checked) << to_string(outcome);
  EXPECT_EQ(checked.error().outcome, outcome) << to_string(checked.error().outcome);
  EXPECT_EQ(checked.error().parameter, parameter);
  EXPECT_NE(checked.error().words.text().find(parameter), std::string::npos);
  EXPECT_FALSE(checked.error().words.remedy.empty());
}

TEST(ParameterTable, RefusesSpecificationsWithFaults) {
  auto specs = test::sample_specs();
  specs.push_back(specs[0]);
  EXPECT_FALSE(ParameterTable::create(specs));
  specs.back().name = "Filter";
  EXPECT_FALSE(ParameterTable::create(specs));
  specs.back().name = "filter.label";
  specs.back().type = driver::ParameterType::kText;
  specs.back().default_value = std::string("\x1b[2J");
  EXPECT_FALSE(ParameterTable::create(specs));
  specs.back().default_value = std::string("plain");
  EXPECT_TRUE(ParameterTable::create(specs));
  while (specs.size() <= driver::kParameterCountMax) {
    specs.push_back(specs[0]);
    specs.back().name += std::to_string(specs.size());
  }
  EXPECT_FALSE(ParameterTable::create(specs));
}

TEST(ParameterTable, RefusesOneBadSettingAmongGoodOnes) {
  const ParameterSetting good{"filter.on", false};
  using enum ConfigurationOutcome;
  expect_refused({good, {"no.such", 1.0}}, false, kUnknownParameter, "no.such");
  expect_refused({good, {"filter.taps", 3.0}}, false, kWrongType, "filter.taps");
  expect_refused({good, {"safety.force_newton_max", 9.5}}, false, kOutOfRange,
                 "safety.force_newton_max");
  expect_refused({good, {"mode", std::string("warp")}}, false, kOutOfRange, "mode");
  expect_refused({good, {"label", std::string("a\nb")}}, false, kOutOfRange, "label");
  expect_refused({good, {"label", std::string("\xff")}}, false, kOutOfRange, "label");
  expect_refused({good, {"encoder.offset_m", std::vector<double>{0, 0}}}, false, kOutOfRange,
                 "encoder.offset_m");
  expect_refused({good, {"firmware", std::string("2")}}, false, kReadOnly, "firmware");
  expect_refused({good, good}, false, kRepeatedParameter, "filter.on");
  expect_refused({good, {"encoder.offset_m", std::vector<double>{0, 0, 0}}}, true, kWrongState,
                 "encoder.offset_m");
}

TEST(ParameterTable, SaysWhatIsAllowed) {
  const auto checked = table().check(Settings{{"safety.force_newton_max", 12.0}}, false);
  ASSERT_FALSE(checked);
  EXPECT_EQ(checked.error().words.text(),
            "safety.force_newton_max = 12 newton is out of range. Remedy: choose 0 to 9.");
}

TEST(ParameterTable, TakesWhatWasApplied) {
  ParameterTable changed = table();
  EXPECT_EQ(changed.commit(Settings{{"filter.on", false}, {"mode", std::string("slow")}}),
            Names{"filter.on"})
      << "the other has its value already";
  EXPECT_EQ(changed.revision(), 41U);
  EXPECT_EQ(changed.changed_settings(), (Settings{{"filter.on", false}}));
  EXPECT_TRUE(changed.commit(Settings{{"filter.on", false}}).empty());
  EXPECT_EQ(changed.revision(), 41U) << "nothing changed";
}

}  // namespace
}  // namespace rtpm::gvd
