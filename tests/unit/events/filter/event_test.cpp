#include <gtest/gtest.h>

#include <array>
#include <cstring>

#include "rtpm/events/event.hpp"

namespace rtpm::events {
namespace {

TEST(Event, RefusesAnEventThatDoesNotFit) {
  std::array<std::byte, 79> memory{};
  EventWriter writer(memory);
  EXPECT_FALSE(writer.put({.type = 1}, std::array{std::byte{1}}));
  EXPECT_TRUE(writer.put({.type = 1}, {}));
}

// ev-2-1
TEST(Event, RejectsMalformedBytes) {
  std::array<std::byte, 80> good{};
  EventWriter writer(good);
  ASSERT_TRUE(writer.put({.type = 7}, std::array{std::byte{1}}));
  for (std::size_t size = 1; size < 65; ++size) {
    EXPECT_EQ(EventReader(ConstBytes(good).first(size)).next().error(), EventError::kBroken);
  }
  for (const std::size_t at : {std::size_t{51}, std::size_t{57}, std::size_t{59}}) {
    auto bad = good;
    bad[at] = std::byte{0x80};
    EXPECT_EQ(EventReader(bad).next().error(), EventError::kBroken) << at;
  }
  auto no_type = good;
  std::memset(no_type.data(), 0, 4);
  EXPECT_EQ(EventReader(no_type).next().error(), EventError::kBroken);
}

}  // namespace
}  // namespace rtpm::events
