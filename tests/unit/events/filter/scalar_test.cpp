#include <gtest/gtest.h>
#include <poses_generated.h>

#include <algorithm>
#include <random>

#include "rtpm/events/scalar.hpp"

// A generated table, read without its generated code.
namespace rtpm::events {
namespace {

struct Built {
  flatbuffers::FlatBufferBuilder builder{};
  [[nodiscard]] ConstBytes bytes() const {
    return std::as_bytes(std::span(builder.GetBufferPointer(), builder.GetSize()));
  }
};

void build(Built& built) {
  const events_test::Point point(1.5, -2.5F, -7);
  const auto hand = events_test::CreateHand(built.builder, 200, &point);
  built.builder.Finish(events_test::CreatePose(built.builder, -3, 4.5, hand));
}

std::optional<Scalar> read(ConstBytes bytes, const FieldPath& path, ScalarType type) {
  return read_scalar(bytes, path, type, Scalar::of(77));
}

TEST(Scalar, IsReadThroughTablesAndStructs) {
  Built built;
  build(built);
  EXPECT_EQ(read(built.bytes(), {.slots = {0}, .slot_count = 1}, ScalarType::kInt32),
            Scalar::of(-3));
  EXPECT_EQ(read(built.bytes(), {.slots = {1}, .slot_count = 1}, ScalarType::kDouble),
            Scalar::of(4.5));
  EXPECT_EQ(read(built.bytes(), {.slots = {2, 0}, .slot_count = 2}, ScalarType::kUint8),
            Scalar::of(std::uint64_t{200}));
  EXPECT_EQ(
      read(built.bytes(), {.slots = {2, 1}, .slot_count = 2, .offset = 8}, ScalarType::kFloat),
      Scalar::of(-2.5));
  EXPECT_EQ(
      read(built.bytes(), {.slots = {2, 1}, .slot_count = 2, .offset = 12}, ScalarType::kInt16),
      Scalar::of(-7));
}

TEST(Scalar, MissingFieldsHaveTheirDefault) {
  Built built;
  built.builder.Finish(events_test::CreatePose(built.builder, 0, 0, 0));
  EXPECT_EQ(read(built.bytes(), {.slots = {0}, .slot_count = 1}, ScalarType::kInt32),
            Scalar::of(77));
  EXPECT_EQ(read(built.bytes(), {.slots = {2, 0}, .slot_count = 2}, ScalarType::kUint8),
            Scalar::of(77));
  EXPECT_EQ(read(built.bytes(), {.slots = {300}, .slot_count = 1}, ScalarType::kInt32),
            Scalar::of(77));
}

// Whatever the bytes are, nothing outside of them is read; the sanitizers check this.
TEST(Scalar, HostileBytesCauseNoReadOutOfBounds) {
  Built built;
  build(built);
  std::mt19937 random(3);
  int count = 0;
  for (int round = 0; round < 20'000; ++round) {
    const std::size_t size = random() % (built.bytes().size() + 1);
    // A heap block of exactly this size, so that the sanitizer sees a read beyond it.
    std::vector<std::byte> bytes(built.bytes().begin(),
                                 built.bytes().begin() + static_cast<std::ptrdiff_t>(size));
    for (int i = 0; i < 4 && size > 0; ++i)
      bytes[random() % size] = static_cast<std::byte>(random());
    if (read(bytes, {.slots = {2, 1}, .slot_count = 2, .offset = 8}, ScalarType::kFloat)) ++count;
    if (read(bytes, {.offset = 60}, ScalarType::kUint64)) ++count;
  }
  EXPECT_GT(count, 0);
}

}  // namespace
}  // namespace rtpm::events
