#include "bar_code.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

namespace rtpm::camerad {
namespace {

TEST(BarCode, IsReadAsPainted) {
  std::vector<std::uint8_t> pixels(640 * 480);
  const Luma picture{pixels, 640, 480};
  for (const std::uint64_t number :
       {std::uint64_t{0}, std::uint64_t{86'255'865'804'108}, ~std::uint64_t{0}}) {
    paint_number(picture, number);
    for (const bool is_lit : {true, false}) {
      paint_lamp(picture, is_lit);
      EXPECT_EQ(read_number(picture), number);
      EXPECT_EQ(read_lamp(picture), is_lit);
    }
  }
}

TEST(BarCode, APictureWithoutOneIsNotRead) {
  std::vector<std::uint8_t> pixels(640 * 480, 128);
  const Luma picture{pixels, 640, 480};
  EXPECT_FALSE(read_number(picture));
  paint_number(picture, 5);
  pixels[26 * 640 + 20] = 16;  // The cell of the lowest bit.
  EXPECT_FALSE(read_number(picture));
}

}  // namespace
}  // namespace rtpm::camerad
