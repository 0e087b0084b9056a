#include "rtpm/wire/counters.hpp"

#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <cstdint>
#include <numeric>

namespace rtpm::wire {
namespace {

TEST(Counters, AddUpFieldByField) {
  using Numbers = std::array<std::uint64_t, sizeof(FrameCounters) / sizeof(std::uint64_t)>;
  Numbers numbers{};
  std::iota(numbers.begin(), numbers.end(), 1U);
  const auto one = std::bit_cast<FrameCounters>(numbers);
  FrameCounters sum = one;
  sum.add(one);
  for (std::uint64_t& number : numbers)
    number *= 2;
  EXPECT_EQ(std::bit_cast<Numbers>(sum), numbers);
}

}  // namespace
}  // namespace rtpm::wire
