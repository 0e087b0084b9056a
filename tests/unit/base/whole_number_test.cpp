#include "rtpm/base/whole_number.hpp"

#include <gtest/gtest.h>

#include <cstdint>

namespace rtpm {
namespace {

TEST(WholeNumber, IsReadFromATextOfDigitsOnly) {
  EXPECT_EQ(whole_number_of<std::uint16_t>("65535"), 65535);
  EXPECT_EQ(whole_number_of<std::int32_t>("-7"), -7);
  for (const char* text : {"", " 7", "7 ", "+7", "-7", "7.0", "0x7", "65536", "seven"})
    EXPECT_FALSE(whole_number_of<std::uint16_t>(text)) << text;
}

}  // namespace
}  // namespace rtpm
