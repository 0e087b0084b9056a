#include "rtpm/crypto/session.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <memory>
#include <set>
#include <type_traits>

#include "crypto_fixture.hpp"

namespace rtpm::crypto::test {
namespace {

// sec-5: one session can't become two with the same counters.
static_assert(!std::is_copy_constructible_v<SealedSession> &&
              !std::is_move_constructible_v<SealedSession> &&
              !std::is_copy_assignable_v<SealedSession> &&
              !std::is_move_assignable_v<SealedSession>);

constexpr std::size_t kHeader = 64;
/// The smallest number of frames per key that a window allows, so that tests reach many keys.
constexpr SessionLimits kShort{.generation_bits = 10};

class Pair {
 public:
  explicit Pair(Suite suite, const SessionLimits& limits = {}, Order order = Order::kAny,
                std::uint64_t seed = 1)
      : random(seed) {
    const KeysOfBoth keys = keys_of_both(suite, random);
    client.emplace(keys.client, order, limits);
    server.emplace(keys.server, order, limits);
  }
  Bytes sealed(const Bytes& payload) {
    const Bytes header = random_bytes(random, kHeader);
    Bytes frame(kHeader + payload.size() + kTrailerSize);
    EXPECT_TRUE(client->seal(header, payload, frame));
    return frame;
  }
  Bytes sealed() { return sealed(random_bytes(random, random() % 40)); }
  /// @return nullopt if the frame was opened, otherwise the error
  std::optional<OpenError> open(Bytes frame) {
    auto payload = server->open(kHeader, frame);
    if (payload) return std::nullopt;
    return payload.error();
  }

  Random random;
  std::optional<SealedSession> client;
  std::optional<SealedSession> server;
};

class SessionTest : public ::testing::TestWithParam<Suite> {
 protected:
  void SetUp() override {
    if ((suites_here() & static_cast<unsigned>(GetParam())) == 0) {
      GTEST_SKIP() << "this machine has no hardware for AES";
    }
  }
};
INSTANTIATE_TEST_SUITE_P(All, SessionTest, ::testing::Values(Suite::kChaChaPoly, Suite::kAesGcm),
                         [](const auto& suite) {
                           return suite.param == Suite::kAesGcm ? "AesGcm" : "ChaChaPoly";
                         });

TEST_P(SessionTest, OpensFramesOfTheOtherSide) {
  Pair pair(GetParam());
  EXPECT_FALSE(pair.server->is_confirmed());
  for (const std::size_t size : {0U, 1U, 15U, 16U, 17U, 48U, 1320U, 65'448U}) {
    const Bytes payload = random_bytes(pair.random, size);
    Bytes frame = pair.sealed(payload);
    EXPECT_FALSE(size > 8 && std::search(frame.begin(), frame.end(), payload.begin(),
                                         payload.end()) != frame.end());
    const auto opened = pair.server->open(kHeader, frame);
    ASSERT_TRUE(opened);
    EXPECT_TRUE(std::ranges::equal(*opened, payload));
  }
  EXPECT_TRUE(pair.server->is_confirmed());
  // A side cannot open frames that it sealed itself.
  Bytes own = pair.sealed();
  EXPECT_EQ(pair.client->open(kHeader, own).error(), OpenError::kForged);
}

TEST_P(SessionTest, SealsInPlace) {
  Pair pair(GetParam());
  const Bytes text = random_bytes(pair.random, kHeader + 100);
  Bytes frame = text;
  frame.resize(text.size() + kTrailerSize);
  ASSERT_TRUE(pair.client->seal(ConstBytes(frame).first(kHeader),
                                ConstBytes(frame).subspan(kHeader, 100), frame));
  EXPECT_TRUE(
      std::ranges::equal(ConstBytes(frame).first(kHeader), ConstBytes(text).first(kHeader)));
  const auto opened = pair.server->open(kHeader, frame);
  ASSERT_TRUE(opened);
  EXPECT_TRUE(std::ranges::equal(*opened, ConstBytes(text).subspan(kHeader)));
}

// sec-5-3: each bit of header, payload, counter and tag; the session does not change.
TEST_P(SessionTest, RefusesAnyFlippedBitWithoutAChange) {
  Pair pair(GetParam());
  const Bytes frame = pair.sealed(random_bytes(pair.random, 20));
  for (std::size_t bit = 0; bit < 8 * frame.size(); ++bit) {
    Bytes flipped = frame;
    flipped[bit / 8] ^= std::byte{1} << (bit % 8);
    const auto error = pair.open(flipped);
    ASSERT_TRUE(error) << bit;
    EXPECT_TRUE(*error == OpenError::kForged || *error == OpenError::kBeyond) << bit;
    EXPECT_FALSE(pair.server->is_confirmed());
  }
  EXPECT_FALSE(pair.open(frame));
  EXPECT_EQ(pair.open(frame), OpenError::kReplayed);
}

TEST_P(SessionTest, RefusesTruncatedAndExtendedFrames) {
  Pair pair(GetParam());
  const Bytes frame = pair.sealed(random_bytes(pair.random, 20));
  for (std::size_t size = 0; size < frame.size(); ++size) {
    const auto error = pair.open(Bytes(frame.begin(), frame.begin() + static_cast<long>(size)));
    ASSERT_TRUE(error);
    if (size < kHeader + kTrailerSize) {
      EXPECT_EQ(*error, OpenError::kTooShort);
    }
  }
  Bytes longer = frame;
  longer.push_back(std::byte{0});
  EXPECT_TRUE(pair.open(longer));
  EXPECT_FALSE(pair.open(frame));
}

// sec-5-2: this holds at the edges of keys, too, and the counter is the frame's.
TEST_P(SessionTest, CountersNeverRepeat) {
  Pair pair(GetParam(), kShort);
  std::set<std::uint64_t> counters;
  for (int i = 0; i < 5000; ++i) {
    const std::uint64_t next = pair.client->send_counter();
    const Bytes frame = pair.sealed();
    EXPECT_EQ(load_le<std::uint64_t>(frame.data() + frame.size() - kTrailerSize), next);
    EXPECT_TRUE(counters.insert(next).second);
  }
  // A frame that does not fit its buffer uses up no counter, because nothing was sealed.
  Bytes small(kHeader);
  const std::uint64_t next = pair.client->send_counter();
  EXPECT_EQ(pair.client->seal(Bytes(kHeader), Bytes(3), small).error(), SealError::kBadSize);
  EXPECT_EQ(pair.client->send_counter(), next);
}

// sec-5-4, sec-5-5: reordered by up to a window, across many keys, with losses and duplicates.
TEST_P(SessionTest, OpensReorderedFramesAcrossKeys) {
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    Pair pair(GetParam(), kShort, Order::kAny, seed);
    std::multimap<std::uint64_t, std::pair<std::uint64_t, Bytes>> in_flight;
    std::uint64_t newest = 0;
    std::set<std::uint64_t> opened;
    const auto deliver = [&] {
      const auto [counter, frame] = in_flight.begin()->second;
      in_flight.erase(in_flight.begin());
      const bool is_in_window = opened.empty() || counter + ReplayWindow::kSize > newest;
      const bool is_new = is_in_window && !opened.contains(counter);
      const auto error = pair.open(frame);
      ASSERT_EQ(!error, is_new) << counter << " newest " << newest;
      if (error) {
        EXPECT_EQ(*error, OpenError::kReplayed);
      }
      opened.insert(counter);
      newest = std::max(newest, counter);
    };
    for (std::uint64_t counter = 0; counter < 8000; ++counter) {
      const Bytes frame = pair.sealed();
      if (pair.random() % 50 == 0) continue;
      in_flight.emplace(counter + pair.random() % 1100, std::pair(counter, frame));
      if (pair.random() % 20 == 0) {
        in_flight.emplace(counter + pair.random() % 1100, std::pair(counter, frame));
      }
      while (!in_flight.empty() && in_flight.begin()->first <= counter)
        deliver();
    }
    while (!in_flight.empty())
      deliver();
  }
}

// sec-5-6
TEST_P(SessionTest, EndsAfterTooManyForgeries) {
  SessionLimits limits;
  limits.forged_max = 100;
  Pair pair(GetParam(), limits);
  const Bytes good = pair.sealed();
  Bytes bad = good;
  bad.back() ^= std::byte{1};
  for (int i = 0; i < 99; ++i)
    EXPECT_EQ(pair.open(bad), OpenError::kForged);
  EXPECT_FALSE(pair.open(good));
  // A duplicate of an opened frame is not a forgery, whatever its tag.
  EXPECT_EQ(pair.open(bad), OpenError::kReplayed);
  Bytes last = pair.sealed();
  last.back() ^= std::byte{1};
  EXPECT_EQ(pair.open(last), OpenError::kForged);
  EXPECT_TRUE(pair.server->has_ended());
  EXPECT_EQ(pair.open(pair.sealed()), OpenError::kEnded);
}

// sec-5-6
TEST_P(SessionTest, EndsAtTheLastCounter) {
  SessionLimits limits = kShort;
  limits.counter_end = 1500;
  Pair pair(GetParam(), limits);
  for (int i = 0; i < 1500; ++i)
    EXPECT_FALSE(pair.open(pair.sealed()));
  Bytes frame(kHeader + kTrailerSize);
  EXPECT_EQ(pair.client->seal(Bytes(kHeader), {}, frame).error(), SealError::kEnded);
  EXPECT_TRUE(pair.client->has_ended());
  EXPECT_FALSE(pair.server->has_ended());
}

// sec-5-7
TEST_P(SessionTest, AcceptsOnlyTheNextCounterOverAStream) {
  Pair pair(GetParam(), kShort, Order::kExact);
  const Bytes first = pair.sealed();
  const Bytes second = pair.sealed();
  const Bytes third = pair.sealed();
  EXPECT_EQ(pair.open(second), OpenError::kReplayed);
  EXPECT_FALSE(pair.open(first));
  EXPECT_EQ(pair.open(third), OpenError::kReplayed);
  EXPECT_FALSE(pair.open(second));
  EXPECT_FALSE(pair.open(third));
  for (int i = 0; i < 3000; ++i)
    ASSERT_FALSE(pair.open(pair.sealed()));
}

TEST_P(SessionTest, SealsAndOpensNothingAfterItsEnd) {
  Pair pair(GetParam());
  const Bytes frame = pair.sealed();
  pair.server->end();
  EXPECT_EQ(pair.open(frame), OpenError::kEnded);
  Bytes out(kHeader + kTrailerSize);
  EXPECT_EQ(pair.server->seal(Bytes(kHeader), {}, out).error(), SealError::kEnded);
}

}  // namespace
}  // namespace rtpm::crypto::test
