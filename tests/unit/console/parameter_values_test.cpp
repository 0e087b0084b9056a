#include "parameters/parameter_values.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace rtpm::console {
namespace {

using driver::ParameterType;
using driver::ParameterValue;
using nlohmann::json;

gvd::Parameter parameter(ParameterType type) {
  gvd::Parameter made;
  made.spec.name = "p";
  made.spec.type = type;
  return made;
}

TEST(ParameterValues, AreReadInTheParametersType) {
  EXPECT_EQ(*value_of(parameter(ParameterType::kBool), true), ParameterValue(true));
  EXPECT_EQ(*value_of(parameter(ParameterType::kInteger), 3), ParameterValue(std::int64_t{3}));
  EXPECT_EQ(*value_of(parameter(ParameterType::kInteger), 3.0), ParameterValue(std::int64_t{3}));
  EXPECT_EQ(*value_of(parameter(ParameterType::kReal), 3), ParameterValue(3.0));
  EXPECT_EQ(*value_of(parameter(ParameterType::kChoice), "fast"),
            ParameterValue(std::string("fast")));
  EXPECT_EQ(*value_of(parameter(ParameterType::kVector), json::array({1, 2.5})),
            ParameterValue(std::vector<double>{1, 2.5}));
}

TEST(ParameterValues, AreRefusedIfOfAnotherType) {
  for (const ParameterType type :
       {ParameterType::kBool, ParameterType::kInteger, ParameterType::kReal, ParameterType::kText,
        ParameterType::kVector}) {
    for (const json& value : {json(), json::object(), json::array({"x"})}) {
      const auto read = value_of(parameter(type), value);
      ASSERT_FALSE(read) << value;
      EXPECT_NE(read.error().find("p takes"), std::string::npos);
    }
  }
  EXPECT_FALSE(value_of(parameter(ParameterType::kInteger), 3.5));
  EXPECT_FALSE(value_of(parameter(ParameterType::kInteger), 1e300));
  EXPECT_FALSE(value_of(parameter(ParameterType::kReal), "3"));
}

TEST(ParameterNames, AreSplitAtTheLongestObject) {
  const std::vector<std::string> objects{"lab/arm0", "lab/arm0.left", "lab"};
  EXPECT_EQ(split_name("lab/arm0.safety.ramp_s", objects).object, "lab/arm0");
  EXPECT_EQ(split_name("lab/arm0.safety.ramp_s", objects).parameter, "safety.ramp_s");
  EXPECT_EQ(split_name("lab/arm0.left.x", objects).object, "lab/arm0.left");
  for (const char* name : {"", ".", "lab/arm0", "lab/arm0.", "lab/arm1.x", "x.y"})
    EXPECT_EQ(split_name(name, objects).object, "") << name;
}

TEST(ParameterInfos, StateTheTypeOfRealNumbers) {
  const auto infos = infos_of(
      "lab/arm0",
      {{"a", 3.0}, {"b", std::int64_t{3}}, {"c", std::vector<double>{1}}, {"d", std::string("x")}});
  ASSERT_EQ(infos.size(), 4U);
  EXPECT_EQ(infos[0].name, "lab/arm0.a");
  EXPECT_EQ(infos[0].type, "float64");
  EXPECT_EQ(infos[1].type, "");
  EXPECT_EQ(infos[2].type, "float64_array");
  EXPECT_EQ(infos[3].value, "x");
}

}  // namespace
}  // namespace rtpm::console
