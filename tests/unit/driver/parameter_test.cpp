#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "rtpm/driver/driver.hpp"

namespace rtpm::driver {
namespace {

ParameterSpec real() {
  return {.name = "encoder.offset_m",
          .type = ParameterType::kReal,
          .unit = "m",
          .low = -0.1,
          .high = 0.1,
          .default_value = 0.0};
}
ParameterSpec integer() {
  return {.name = "count",
          .type = ParameterType::kInteger,
          .low = 1,
          .high = 9,
          .default_value = std::int64_t{4}};
}
ParameterSpec vector() {
  return {.name = "gains",
          .type = ParameterType::kVector,
          .low = 0,
          .high = 1,
          .vector_size = 2,
          .default_value = std::vector<double>{0, 1}};
}
ParameterSpec choice() {
  return {.name = "mode",
          .type = ParameterType::kChoice,
          .choices = {"slow", "fast"},
          .default_value = std::string("slow")};
}

TEST(Parameter, TakesValuesOfItsTypeAndRange) {
  EXPECT_EQ(check(real(), 0.1), ValueFault::kNone) << "the ends belong to the range";
  EXPECT_EQ(check(integer(), std::int64_t{9}), ValueFault::kNone);
  EXPECT_EQ(check(vector(), std::vector<double>{0.5, 0.5}), ValueFault::kNone);
  EXPECT_EQ(check(choice(), std::string("fast")), ValueFault::kNone);
  const ParameterSpec flag{.name = "flag", .type = ParameterType::kBool, .default_value = false};
  EXPECT_EQ(check(flag, true), ValueFault::kNone);
}

TEST(Parameter, RefusesValuesOutsideItsRange) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinite = std::numeric_limits<double>::infinity();
  EXPECT_EQ(check(real(), std::nextafter(0.1, 1.0)), ValueFault::kOutOfRange);
  EXPECT_EQ(check(real(), nan), ValueFault::kOutOfRange);
  ParameterSpec unbounded = real();
  unbounded.low = -infinite;
  unbounded.high = infinite;
  EXPECT_EQ(check(unbounded, infinite), ValueFault::kOutOfRange) << "no value is infinite";
  EXPECT_EQ(check(integer(), std::int64_t{0}), ValueFault::kOutOfRange);
  EXPECT_EQ(check(vector(), std::vector<double>{0.5}), ValueFault::kOutOfRange);
  EXPECT_EQ(check(vector(), std::vector<double>{0.5, 1.5}), ValueFault::kOutOfRange);
  EXPECT_EQ(check(vector(), std::vector<double>{0.5, nan}), ValueFault::kOutOfRange);
  EXPECT_EQ(check(choice(), std::string("Fast")), ValueFault::kOutOfRange);
  const ParameterSpec text{
      .name = "text", .type = ParameterType::kText, .default_value = std::string()};
  EXPECT_EQ(check(text, std::string(kParameterTextSizeMax + 1, 'a')), ValueFault::kOutOfRange);
}

TEST(Parameter, RefusesValuesOfAnotherType) {
  EXPECT_EQ(check(real(), std::int64_t{0}), ValueFault::kWrongType);
  EXPECT_EQ(check(integer(), 4.0), ValueFault::kWrongType);
  EXPECT_EQ(check(choice(), true), ValueFault::kWrongType);
  EXPECT_EQ(check(vector(), 0.5), ValueFault::kWrongType);
}

TEST(Parameter, NamesFaultsOfItsSpecification) {
  for (const ParameterSpec& good : {real(), integer(), vector(), choice()}) {
    EXPECT_EQ(fault_of(good), "") << good.name;
  }
  for (const char* name : {"", ".", "a.", ".a", "a..b", "Force", "a b", "ü"}) {
    ParameterSpec spec = real();
    spec.name = name;
    EXPECT_NE(fault_of(spec).find("name"), std::string::npos) << name;
  }
  ParameterSpec spec = real();
  spec.low = 1;
  EXPECT_EQ(fault_of(spec), "its range has no values");
  spec = real();
  spec.default_value = 0.2;
  EXPECT_EQ(fault_of(spec), "its default is out of range");
  spec.default_value = false;
  EXPECT_EQ(fault_of(spec), "its default is not of type real");
  spec = integer();
  spec.high = 9.5;
  EXPECT_NE(fault_of(spec).find("whole numbers"), std::string::npos);
  spec = choice();
  spec.choices.clear();
  EXPECT_NE(fault_of(spec).find("choices"), std::string::npos);
  spec = vector();
  spec.vector_size = 0;
  EXPECT_NE(fault_of(spec).find("elements"), std::string::npos);
}

}  // namespace
}  // namespace rtpm::driver
