#include "rtpm/program/text.hpp"

#include <gtest/gtest.h>

namespace rtpm::program {
namespace {

TEST(Formatted, IsAsPrintfPrintsIt) {
  EXPECT_EQ(formatted("%-4s|%5.2f|%d%%", "x", 1.25, 7), "x   | 1.25|7%");
  EXPECT_EQ(formatted("%s", ""), "");
  EXPECT_EQ(formatted("%1000d", 1).size(), 1000u);
}

}  // namespace
}  // namespace rtpm::program
