#include "rtpm/wire/header.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "frames.hpp"

// Any bytes are safe to read; spec/vectors has the cases of each field.
namespace rtpm::wire {
namespace {

using namespace test;

/// The first `size` bytes, padded with zeros.
Bytes resized(const Bytes& bytes, std::size_t size) {
  Bytes result(size);
  std::copy_n(bytes.begin(), std::min(size, bytes.size()), result.begin());
  return result;
}

/// Accepted bytes must equal the encoding of the decoded header: two byte strings never mean the
/// same header, and no bit is ignored.
void check_bytes(const Bytes& bytes) {
  const auto header = decode_frame(bytes);
  if (!header) return;
  ASSERT_EQ(bytes.size(), kHeaderSize + header->payload_size);
  Bytes again(kHeaderSize);
  encode(*header, again.data());
  ASSERT_TRUE(std::equal(again.begin(), again.end(), bytes.begin()));
}

TEST(Frame, OfRandomBytesIsNeverTakenWrongly) {
  Random random(2);
  int taken_count = 0;
  for (int round = 0; round < 20'000; ++round) {
    Bytes bytes = random_bytes(random, random() % 200);
    check_bytes(bytes);
    // Most random bytes fail at the magic: this lets them pass more and more of the checks.
    bytes = frame_of(random_header(random), bytes);
    const std::size_t change_count = random() % 3;
    for (std::size_t i = 0; i < change_count; ++i) {
      bytes[random() % bytes.size()] = static_cast<std::byte>(random());
    }
    if (random() % 4 == 0) bytes = resized(bytes, random() % (bytes.size() + 3));
    check_bytes(bytes);
    taken_count += decode_frame(bytes) ? 1 : 0;
  }
  EXPECT_GT(taken_count, 1000) << "the test must reach both outcomes";
  EXPECT_LT(taken_count, 19'000);
}

TEST(Frame, WithAnyOneBitTurnedIsDroppedOrReadDifferently) {
  Random random(3);
  const Bytes good = frame_of(random_header(random), random_bytes(random, 5));
  for (std::size_t bit = 0; bit < kHeaderSize * 8; ++bit) {
    Bytes frame = good;
    frame[bit / 8] ^= static_cast<std::byte>(1u << (bit % 8));
    check_bytes(frame);
  }
}

TEST(Counters, AddUpEachForItself) {
  FrameCounters one;
  one.received_count = 1;
  one.duplicate_answered_count = 2;
  one.expired_count = 3;
  one.refused_count = 4;
  one.session_opened_count = 5;
  one.session_evicted_count = 6;
  one.cancelled_count = 7;
  one.orphaned_count = 8;
  one.item_count = 9;
  one.item_repeated_count = 10;
  one.large_evicted_count = 11;
  for (std::size_t i = 0; i < kDropReasonCount; ++i) {
    for (std::size_t count = 0; count <= i; ++count)
      one.drop(static_cast<DropReason>(i));
  }
  FrameCounters sum = one;
  sum.add(one);
  EXPECT_EQ(sum.received_count, 2u);
  EXPECT_EQ(sum.duplicate_answered_count, 4u);
  EXPECT_EQ(sum.expired_count, 6u);
  EXPECT_EQ(sum.refused_count, 8u);
  EXPECT_EQ(sum.session_opened_count, 10u);
  EXPECT_EQ(sum.session_evicted_count, 12u);
  EXPECT_EQ(sum.cancelled_count, 14u);
  EXPECT_EQ(sum.orphaned_count, 16u);
  EXPECT_EQ(sum.item_count, 18u);
  EXPECT_EQ(sum.item_repeated_count, 20u);
  EXPECT_EQ(sum.large_evicted_count, 22u);
  for (std::size_t i = 0; i < kDropReasonCount; ++i) {
    EXPECT_EQ(sum.dropped_for(static_cast<DropReason>(i)), 2 * (i + 1));
  }
}

}  // namespace
}  // namespace rtpm::wire
