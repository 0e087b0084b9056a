#include "rtpm/wire/handshake.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "frames.hpp"

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

TEST(Hello, ComesBackAsItWasWritten) {
  Random random(1);
  for (int round = 0; round < 500; ++round) {
    const Hello hello = random_hello(random);
    const auto read = decode_hello(encoded(hello));
    ASSERT_TRUE(read);
    EXPECT_EQ(read->version_min, hello.version_min);
    EXPECT_EQ(read->version_max, hello.version_max);
    EXPECT_EQ(read->features, hello.features);
    EXPECT_EQ(read->client_epoch, hello.client_epoch);
    EXPECT_EQ(read->channel, hello.channel);
    EXPECT_EQ(read->clock_domain, hello.clock_domain);
    EXPECT_EQ(read->message_size_max, hello.message_size_max);
    EXPECT_EQ(read->cookie, hello.cookie);
  }
}

TEST(Welcome, ComesBackAsItWasWritten) {
  Random random(2);
  for (int round = 0; round < 500; ++round) {
    const Welcome welcome = random_welcome(random);
    const auto read = decode_welcome(encoded(welcome));
    ASSERT_TRUE(read);
    EXPECT_EQ(read->version, kVersion);
    EXPECT_EQ(read->band, welcome.band);
    EXPECT_EQ(read->ceiling, welcome.ceiling);
    EXPECT_EQ(read->features, welcome.features);
    EXPECT_EQ(read->window, welcome.window);
    EXPECT_EQ(read->server_epoch, welcome.server_epoch);
    EXPECT_EQ(read->clock_domain, welcome.clock_domain);
    EXPECT_EQ(read->message_size_max, welcome.message_size_max);
  }
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

// hp-4.1-1, hp-4.3-1
TEST(Handshake, PayloadsWithAReservedByteSetAreNotRead) {
  Random random(4);
  for (const std::size_t offset : {36u, 37u, 38u, 39u, 56u, 57u, 58u, 59u, 60u, 61u, 62u, 63u}) {
    Bytes bytes = encoded(random_hello(random));
    ASSERT_EQ(bytes[offset], std::byte{0});
    bytes[offset] = std::byte{1};
    EXPECT_FALSE(decode_hello(bytes)) << offset;
  }
  for (const std::size_t offset :
       {14u, 15u, 36u, 37u, 38u, 39u, 40u, 41u, 42u, 43u, 44u, 45u, 46u, 47u}) {
    Bytes bytes = encoded(random_welcome(random));
    ASSERT_EQ(bytes[offset], std::byte{0});
    bytes[offset] = std::byte{1};
    EXPECT_FALSE(decode_welcome(bytes)) << offset;
  }
}

TEST(Hello, WithoutAnEpochIsNotRead) {
  Random random(5);
  Hello hello = random_hello(random);
  hello.client_epoch = 0;
  EXPECT_FALSE(decode_hello(encoded(hello)));
}

// hp-4.3-1
TEST(Welcome, ThatCanNotBeMeantIsNotRead) {
  Random random(6);
  const Welcome good = random_welcome(random);
  ASSERT_TRUE(decode_welcome(encoded(good)));

  Welcome welcome = good;
  welcome.window = 0;
  EXPECT_FALSE(decode_welcome(encoded(welcome))) << "no call could ever be made";
  for (const std::uint16_t window : {std::uint16_t{3}, std::uint16_t{7}, std::uint16_t{65535}}) {
    welcome.window = window;
    EXPECT_FALSE(decode_welcome(encoded(welcome)))
        << "places would shift where numbers begin again: " << window;
  }
  welcome = good;
  welcome.server_epoch = 0;
  EXPECT_FALSE(decode_welcome(encoded(welcome))) << "a restart could not be told";
  welcome = good;
  welcome.version = 2;
  EXPECT_FALSE(decode_welcome(encoded(welcome))) << "a version that was not offered";
  welcome = good;
  welcome.features = 1;
  EXPECT_FALSE(decode_welcome(encoded(welcome))) << "a feature that was not offered";
  welcome = good;
  for (const std::uint32_t bad : {0u, kMessageSizeFloor - 1, kMessageSizeCeiling + 1, ~0u}) {
    welcome.message_size_max = bad;
    EXPECT_FALSE(decode_welcome(encoded(welcome))) << "an absurd limit: " << bad;
  }
  for (const std::uint32_t limit : {kMessageSizeFloor, kMessageSizeCeiling}) {
    welcome.message_size_max = limit;
    EXPECT_TRUE(decode_welcome(encoded(welcome))) << limit;
  }
  welcome = good;
  welcome.band = {100, 99};
  EXPECT_FALSE(decode_welcome(encoded(welcome))) << "a band from high to low";
  for (const std::size_t offset : {2u, 4u, 6u}) {
    Bytes bytes = encoded(good);
    bytes[offset + 1] |= std::byte{0x80};
    EXPECT_FALSE(decode_welcome(bytes)) << "a priority above 32767 at offset " << offset;
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
