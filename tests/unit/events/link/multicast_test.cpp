#include "broadcast/multicast.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <random>
#include <string>

// Multicast datagrams, lost and repaired (ev-7).
namespace rtpm::events {
namespace {

constexpr std::uint64_t kId = 99;
constexpr std::uint32_t kMe = 7;
using Datagram = std::vector<std::byte>;
using Records = std::vector<Datagram>;

Datagram copy_of(ConstBytes bytes) {
  return {bytes.begin(), bytes.end()};
}

Datagram content(std::size_t size, int seed = 1) {
  Datagram bytes(size);
  for (std::size_t i = 0; i < size; ++i)
    bytes[i] = static_cast<std::byte>(i * 31 + static_cast<std::size_t>(seed));
  return bytes;
}

class Multicast : public testing::Test {
 protected:
  /// Writes a record and returns its datagrams.
  std::vector<Datagram> write(const Datagram& bytes, std::vector<std::uint32_t> owners = {kMe}) {
    std::vector<Datagram> sent;
    EXPECT_TRUE(
        writer.write(owners, bytes, [&](ConstBytes each) { sent.push_back(copy_of(each)); }));
    if (std::ranges::find(owners, kMe) != owners.end()) ++written;
    return sent;
  }
  void take(const std::vector<Datagram>& datagrams) {
    for (const Datagram& each : datagrams)
      EXPECT_TRUE(reader.take(each));
  }
  /// All records that can be read now; each has one event.
  std::vector<Datagram> read() {
    std::vector<Datagram> records;
    while (reader.read()) {
      records.push_back(copy_of(reader.events()));
      EXPECT_EQ(reinterpret_cast<std::uintptr_t>(reader.events().data()) % 16, 0U);
      reader.count_read(1);
    }
    return records;
  }
  /// Requests missing datagrams from the writer, as a consumer does from its hub.
  void repair() {
    while (const auto gap = reader.gap()) {
      for (std::uint64_t i = 0; i <= 64; ++i) {
        if (i > 0 && (gap->later >> (i - 1) & 1) == 0) continue;
        const ConstBytes kept = writer.datagram(gap->first + i);
        if (!kept.empty()) {
          EXPECT_TRUE(reader.take(kept));
        }
      }
      reader.note(writer.oldest_sequence(), writer.next_sequence(), written);
    }
  }

  MulticastWriter writer{kId, 64};
  MulticastReader reader{kId, kMe, 0};
  std::uint64_t written = 0;
};

TEST_F(Multicast, SkipsRecordsOfOtherOwners) {
  take(write(content(5000), {1, 2, 3}));
  take(write(content(50), {1, kMe, 3}));
  EXPECT_EQ(read(), Records{content(50)});
  EXPECT_EQ(reader.missed_count(), 0U);
}

TEST_F(Multicast, AddressesAsManyOwnersAsARecordHolds) {
  std::vector<std::uint32_t> owners(kMulticastOwnerCountMax);
  for (std::uint32_t i = 0; i < owners.size(); ++i)
    owners[i] = 1000 + i;
  owners.back() = kMe;
  const auto sent = write(content(3000), owners);
  EXPECT_LE(sent[0].size(), kMulticastDatagramMax);
  take(sent);
  EXPECT_EQ(read(), Records{content(3000)});
  owners.push_back(1);
  EXPECT_FALSE(writer.write(owners, content(1), [](ConstBytes) {}));
}

// ev-7.2-1
TEST_F(Multicast, OrdersDatagramsAndDropsDuplicates) {
  std::vector<Datagram> all;
  std::vector<Datagram> records;
  for (int i = 0; i < 5; ++i) {
    records.push_back(content(3000, i));
    for (const Datagram& each : write(records.back()))
      all.insert(all.end(), 2, each);
  }
  std::ranges::shuffle(all, std::mt19937(1));
  take(all);
  EXPECT_EQ(read(), records);
}

// ev-7.2-2
TEST_F(Multicast, DetectsAGapByLaterDatagrams) {
  const auto first = write(content(10));
  const auto lost = write(content(4000));
  EXPECT_FALSE(reader.gap());
  take(first);
  take(write(content(20)));
  ASSERT_TRUE(reader.gap());
  EXPECT_EQ(reader.gap()->first, 1U);
  ASSERT_EQ(lost.size(), 3U);
  EXPECT_EQ(reader.gap()->later, 0b11U) << "the one behind them is there";
  EXPECT_EQ(read().size(), 1U) << "what is behind the gap waits";
  take(lost);
  EXPECT_EQ(read(), (Records{content(4000), content(20)}));
}

// ev-7.2-3
TEST_F(Multicast, DetectsTheLossOfTheLastDatagramByTheHeartbeat) {
  static_cast<void>(write(content(10)));
  EXPECT_FALSE(reader.gap());
  EXPECT_TRUE(reader.take(writer.heartbeat()));
  ASSERT_TRUE(reader.gap());
  EXPECT_EQ(reader.gap()->first, 0U);
  EXPECT_EQ(reader.gap()->later, 0U);
  repair();
  EXPECT_EQ(read(), Records{content(10)});
  EXPECT_TRUE(reader.take(writer.heartbeat()));
  EXPECT_FALSE(reader.gap());
}

// ev-7.3-1
TEST_F(Multicast, RepairsAnyLoss) {
  std::mt19937 random(7);
  std::vector<Datagram> wanted;
  std::vector<Datagram> got;
  for (int i = 0; i < 2000; ++i) {
    wanted.push_back(content(16 + random() % 3000, i));
    for (const Datagram& each : write(wanted.back())) {
      if (random() % 3 == 0) continue;
      EXPECT_TRUE(reader.take(each));
    }
    if (random() % 4 == 0) repair();
    for (Datagram& each : read())
      got.push_back(std::move(each));
  }
  EXPECT_TRUE(reader.take(writer.heartbeat()));
  repair();
  for (Datagram& each : read())
    got.push_back(std::move(each));
  EXPECT_EQ(got, wanted);
  EXPECT_EQ(reader.missed_count(), 0U);
}

// ev-7.3-2
TEST_F(Multicast, CountsEvictedRecordsAsLost) {
  take(write(content(10)));
  EXPECT_EQ(read().size(), 1U);
  for (int i = 0; i < 100; ++i)
    static_cast<void>(write(content(10, i), i % 2 == 0 ? std::vector{kMe} : std::vector{kMe + 1}));
  EXPECT_TRUE(reader.take(writer.heartbeat()));
  repair();
  const std::size_t left = read().size();
  // The writer keeps 64 of the 100 datagrams; half of these are the reader's own.
  EXPECT_EQ(left, 32U);
  EXPECT_EQ(reader.missed_count(), 18U);
  take(write(content(77)));
  EXPECT_EQ(read(), Records{content(77)});
  EXPECT_EQ(reader.missed_count(), 18U);
}

TEST_F(Multicast, SkipsARecordWhoseBeginningIsLost) {
  MulticastReader late{kId, kMe, 0};
  const auto cut = write(content(3000));
  const auto whole = write(content(30));
  late.note(1, 4, 2);
  for (const Datagram& each : cut)
    EXPECT_TRUE(late.take(each));
  for (const Datagram& each : whole)
    EXPECT_TRUE(late.take(each));
  ASSERT_TRUE(late.read());
  EXPECT_EQ(copy_of(late.events()), content(30));
  late.count_read(1);
  EXPECT_FALSE(late.read());
  EXPECT_EQ(late.missed_count(), 1U);
}

TEST_F(Multicast, RefusesARecordTooLargeForTheHistory) {
  EXPECT_FALSE(writer.write(std::array{kMe}, content(64 * 1400 / 4 + 1400), [](ConstBytes) {}));
  EXPECT_EQ(writer.next_sequence(), 0U);
}

TEST_F(Multicast, BeginsWhereItsSubscriptionBegins) {
  for (int i = 0; i < 10; ++i)
    static_cast<void>(write(content(10)));
  MulticastReader late{kId, kMe, writer.next_sequence()};
  EXPECT_TRUE(late.take(writer.heartbeat()));
  EXPECT_FALSE(late.gap());
}

// ev-7.1-1
TEST_F(Multicast, RejectsMalformedDatagrams) {
  const Datagram good = write(content(10))[0];
  ASSERT_TRUE(read_multicast(good));
  for (std::size_t size = 0; size < kMulticastHeaderSize + 5; ++size)
    EXPECT_FALSE(read_multicast(ConstBytes(good).first(size))) << size;
  for (const std::size_t at : {0U, 3U, 4U, 5U, 7U, 27U, 31U}) {
    Datagram bad = good;
    bad[at] ^= std::byte{0x80};
    EXPECT_FALSE(read_multicast(bad)) << at;
  }
  Datagram longer = good;
  longer.push_back(std::byte{1});
  EXPECT_FALSE(read_multicast(longer));
  Datagram other = good;
  other[8] ^= std::byte{1};
  EXPECT_TRUE(read_multicast(other));
  EXPECT_FALSE(reader.take(other)) << "another hub's";
  std::mt19937 random(3);
  for (int i = 0; i < 20'000; ++i) {
    Datagram noise = good;
    for (int k = 0; k < 3; ++k)
      noise[random() % noise.size()] = static_cast<std::byte>(random());
    static_cast<void>(reader.take(noise));
    while (reader.read())
      static_cast<void>(reader.gap());
  }
}

}  // namespace
}  // namespace rtpm::events
