#include "rtpm/base/ring.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <memory>
#include <thread>
#include <utility>

namespace rtpm {
namespace {

TEST(SpscRing, LeavesTheValueWithTheCallerWhenFull) {
  SpscRing<std::unique_ptr<int>, 2> ring;
  for (int i = 0; i < 2; ++i) {
    auto value = std::make_unique<int>(i);
    ASSERT_TRUE(ring.push(value));
    EXPECT_EQ(value, nullptr) << "a value that was taken is gone from the caller";
  }
  auto refused = std::make_unique<int>(7);
  EXPECT_FALSE(ring.push(refused));
  ASSERT_NE(refused, nullptr);
  EXPECT_EQ(*refused, 7);

  EXPECT_EQ(**ring.pop(), 0);
  EXPECT_TRUE(ring.push(refused)) << "one pop frees one slot";
  EXPECT_EQ(**ring.pop(), 1);
  EXPECT_EQ(**ring.pop(), 7);
}

TEST(SpscRing, PassesEachValueBetweenThreadsOnceInOrder) {
  constexpr std::uint64_t kCount = 200'000;
  SpscRing<std::uint64_t, 8> ring;
  std::thread producer([&] {
    for (std::uint64_t number = 0; number < kCount;) {
      std::uint64_t value = number;
      if (ring.push(value)) {
        ++number;
      } else {
        std::this_thread::yield();
      }
    }
  });
  std::uint64_t wrong_count = 0;
  for (std::uint64_t expected_next = 0; expected_next < kCount;) {
    const auto value = ring.pop();
    if (!value) {
      std::this_thread::yield();
      continue;
    }
    if (*value != expected_next) ++wrong_count;
    ++expected_next;
  }
  producer.join();
  EXPECT_EQ(wrong_count, 0u);
  EXPECT_FALSE(ring.pop());
}

}  // namespace
}  // namespace rtpm
