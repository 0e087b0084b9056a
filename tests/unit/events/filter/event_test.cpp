#include <gtest/gtest.h>

#include <array>
#include <cstring>
#include <vector>

#include "rtpm/events/event.hpp"

namespace rtpm::events {
namespace {

EventHeader sample_header() {
  return {.type = 7,
          .source = 9,
          .sequence = 1ULL << 40,
          .origin = time_from_ns(-5),
          .hub_received = time_from_ns(6),
          .hub_sent = time_from_ns(7),
          .schema_id = 0xfedc'ba98'7654'3210,
          .origin_uncertainty_ns = 300,
          .priority = 32767,
          .hops_left = 3,
          .is_replayed = true,
          .is_continued = true,
          .supplier_tag = 0xabcd'ef01};
}

TEST(Event, ComesBackAsItWasWritten) {
  alignas(16) std::array<std::byte, 512> memory{};
  EventWriter writer(memory);
  const std::array payload{std::byte{1}, std::byte{2}, std::byte{3}};
  ASSERT_TRUE(writer.put(sample_header(), payload));
  ASSERT_TRUE(writer.put({.type = 1}, {}));
  EXPECT_EQ(writer.bytes().size(), event_span(3) + event_span(0));
  EventReader reader(writer.bytes());
  const auto first = reader.next();
  ASSERT_TRUE(first);
  EXPECT_EQ(first->header, sample_header());
  ASSERT_EQ(first->payload.size(), 3U);
  EXPECT_EQ(first->payload[2], std::byte{3});
  EXPECT_EQ(first->payload.data() - memory.data(), 64);
  ASSERT_TRUE(reader.next());
  EXPECT_EQ(reader.next().error(), EventError::kEnd);
}

TEST(Event, DoesNotFitWhereThereIsNoRoom) {
  std::array<std::byte, 79> memory{};
  EventWriter writer(memory);
  EXPECT_FALSE(writer.put({.type = 1}, std::array{std::byte{1}}));
  EXPECT_TRUE(writer.put({.type = 1}, {}));
}

// ev-2-1
TEST(Event, BytesThatAreNoneAreRefusedWhereverTheyAreWrong) {
  std::array<std::byte, 80> good{};
  EventWriter writer(good);
  ASSERT_TRUE(writer.put(sample_header(), std::array{std::byte{1}}));
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
