#include "rtpm/wire/handshake.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "frames.hpp"

// Any payload is safe to read; spec/vectors has the cases of each field.
namespace rtpm::wire {
namespace {

using namespace test;

Hello random_hello(Random& random) {
  Hello hello;
  hello.version_min = static_cast<std::uint16_t>(random());
  hello.version_max = static_cast<std::uint16_t>(random());
  hello.features = static_cast<std::uint32_t>(random());
  hello.client_epoch = random() | 1;
  hello.channel = random();
  hello.clock_domain = random();
  hello.message_size_max = static_cast<std::uint32_t>(random());
  for (std::byte& byte : hello.cookie)
    byte = static_cast<std::byte>(random());
  return hello;
}

int random_priority(Random& random) {
  return static_cast<int>(random() % (Priority::kHighest + 1));
}

Welcome random_welcome(Random& random) {
  Welcome welcome;
  const int low = random_priority(random);
  const int high = random_priority(random);
  welcome.band = {std::min(low, high), std::max(low, high)};
  welcome.ceiling = random_priority(random);
  welcome.window = static_cast<std::uint16_t>(1u << random() % 16);
  welcome.server_epoch = random() | 1;
  welcome.clock_domain = random();
  constexpr std::uint32_t kSizes = kMessageSizeCeiling - kMessageSizeFloor + 1;
  welcome.message_size_max = kMessageSizeFloor + static_cast<std::uint32_t>(random() % kSizes);
  return welcome;
}

template <class T>
Bytes encoded(const T& value) {
  Bytes bytes(T::kSize, std::byte{0xee});
  encode(value, bytes);
  return bytes;
}

TEST(Handshake, PayloadsOfAnotherSizeAreNotRead) {
  Random random(3);
  for (std::size_t size = 0; size < 200; ++size) {
    Bytes hello = encoded(random_hello(random));
    Bytes welcome = encoded(random_welcome(random));
    hello.resize(size);
    welcome.resize(size);
    hello.shrink_to_fit();
    welcome.shrink_to_fit();
    EXPECT_EQ(decode_hello(hello).has_value(), size == Hello::kSize) << size;
    EXPECT_EQ(decode_welcome(welcome).has_value(), size == Welcome::kSize) << size;
  }
}

// Decoding loses nothing: encoding the result gives the same bytes.
TEST(Handshake, RandomPayloadsAreReadWhollyOrNotAtAll) {
  Random random(7);
  for (int round = 0; round < 5000; ++round) {
    Bytes hello = encoded(random_hello(random));
    hello[random() % hello.size()] = static_cast<std::byte>(random());
    if (const auto read = decode_hello(hello)) {
      ASSERT_EQ(encoded(*read), hello);
    }
    Bytes welcome = encoded(random_welcome(random));
    welcome[random() % welcome.size()] = static_cast<std::byte>(random());
    if (const auto read = decode_welcome(welcome)) {
      ASSERT_EQ(encoded(*read), welcome);
    }
  }
}

}  // namespace
}  // namespace rtpm::wire
