#include "rtpm/device_io/buttons.hpp"

#include <gtest/gtest.h>

#include <array>

namespace rtpm::test {
namespace {

TEST(Buttons, CountAnEdgeForEachChange) {
  std::array<std::uint16_t, 3> edges{0, 7, 0xffff};
  device_io::count_edges(0b0101, 0b1110, edges);
  EXPECT_EQ(edges, (std::array<std::uint16_t, 3>{1, 8, 0xffff})) << "the fourth has no counter";
  device_io::count_edges(0b000, 0b100, edges);
  EXPECT_EQ(edges[2], 0) << "modulo 65536";
}

TEST(Buttons, GetTheEdgesSinceTheLastSample) {
  driver::Sample sample;
  sample.buttons = 0b001;
  sample.button_edges[0] = 5;
  const std::array<std::uint16_t, 3> before{10, 0xffff, 0};
  const std::array<std::uint16_t, 3> now{11, 2, 0};
  device_io::take_buttons(sample, 0b110, before, now);
  EXPECT_EQ(sample.buttons, 0b110u);
  EXPECT_EQ(sample.button_edges[0], 6);
  EXPECT_EQ(sample.button_edges[1], 3) << "across the counter's end";
  EXPECT_EQ(sample.button_edges[2], 1) << "changed while the device was gone";
}

TEST(Buttons, KeepEdgesConsistentWithTheState) {
  driver::Sample sample;
  const std::array<std::uint16_t, 1> before{0};
  const std::array<std::uint16_t, 1> now{2};
  device_io::take_buttons(sample, 0b1, before, now);
  EXPECT_EQ(sample.button_edges[0], 3);
}

}  // namespace
}  // namespace rtpm::test
