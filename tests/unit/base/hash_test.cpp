#include "rtpm/base/hash.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstddef>
#include <cstdint>

namespace rtpm {
namespace {

// Test vectors published with the algorithm: http://www.isthe.com/chongo/tech/comp/fnv/.
TEST(Fnv1a, AgreesWithThePublishedVectors) {
  static_assert(fnv1a_64("") == 0xcbf29ce484222325ull);
  static_assert(fnv1a_64("a") == 0xaf63dc4c8601ec8cull);
  static_assert(fnv1a_64("foobar") == 0x85944171f73967e8ull);
  EXPECT_EQ(fnv1a_64("bar", fnv1a_64("foo")), fnv1a_64("foobar"))
      << "a hash can be continued where it stopped";
}

TEST(Crc32, MatchesItsCheckValueInOneOrTwoParts) {
  const auto bytes = std::as_bytes(std::span("123456789", 9));
  EXPECT_EQ(crc32(bytes), 0xcbf43926u);
  EXPECT_EQ(crc32(bytes.subspan(4), crc32(bytes.first(4))), 0xcbf43926u);
  EXPECT_EQ(crc32({}), 0u);
}

// The vectors of the reference implementation: key 00 01 … 0f, input 00 01 … of growing length.
// This list has those of 0…8 and of 15 bytes (15 is the worked example in the paper's appendix).
TEST(SipHash, AgreesWithThePublishedVectors) {
  const SipKey key{.low = 0x0706050403020100ull, .high = 0x0f0e0d0c0b0a0908ull};
  std::array<std::byte, 64> input{};
  for (std::size_t i = 0; i < input.size(); ++i)
    input[i] = static_cast<std::byte>(i);
  constexpr std::array<std::uint64_t, 9> kByLength{
      0x726fdb47dd0e0e31ull, 0x74f839c593dc67fdull, 0x0d6c8009d9a94f5aull,
      0x85676696d7fb7e2dull, 0xcf2794e0277187b7ull, 0x18765564cd99a68dull,
      0xcbc9466e58fee3ceull, 0xab0200f58b01d137ull, 0x93f5f5799a932462ull};
  for (std::size_t length = 0; length < kByLength.size(); ++length) {
    EXPECT_EQ(siphash_2_4(key, std::span(input).first(length)), kByLength[length])
        << "for " << length << " bytes";
  }
  EXPECT_EQ(siphash_2_4(key, std::span(input).first(15)), 0xa129ca6149be45e5ull);
}

}  // namespace
}  // namespace rtpm
