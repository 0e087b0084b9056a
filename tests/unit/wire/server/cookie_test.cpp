#include "rtpm/wire/cookie.hpp"

#include <gtest/gtest.h>

#include "frames.hpp"

namespace rtpm::wire {
namespace {

using namespace test;
using namespace std::chrono_literals;

constexpr SipKey kKey{.low = 0x1122334455667788, .high = 0x99aabbccddeeff00};
constexpr PeerAddress kPeer{.high = 1, .low = 0x7f000001, .port = 4711};
constexpr std::uint64_t kEpoch = 77;

TEST(CookieJar, AcceptsItsOwnCookie) {
  const CookieJar jar(kKey);
  const Cookie cookie = jar.give(kPeer, kEpoch, at(0s));
  EXPECT_TRUE(jar.is_good(cookie, kPeer, kEpoch, at(0s)));
  EXPECT_NE(cookie, Cookie{}) << "zero means no cookie in a HELLO";
}

TEST(CookieJar, RefusesACookieOfAnotherPeerOrServer) {
  const CookieJar jar(kKey);
  const Cookie cookie = jar.give(kPeer, kEpoch, at(0s));
  PeerAddress other = kPeer;
  other.port = 4712;
  EXPECT_FALSE(jar.is_good(cookie, other, kEpoch, at(0s))) << "another port";
  other = kPeer;
  other.low ^= 1;
  EXPECT_FALSE(jar.is_good(cookie, other, kEpoch, at(0s))) << "another host";
  other = kPeer;
  other.high = 0;
  EXPECT_FALSE(jar.is_good(cookie, other, kEpoch, at(0s))) << "another connection";
  EXPECT_FALSE(jar.is_good(cookie, kPeer, kEpoch + 1, at(0s))) << "another life of the client";
  const CookieJar other_jar({.low = kKey.low, .high = kKey.high ^ 1});
  EXPECT_FALSE(other_jar.is_good(cookie, kPeer, kEpoch, at(0s))) << "another life of the server";
  EXPECT_FALSE(jar.is_good(Cookie{}, kPeer, kEpoch, at(0s))) << "none at all";
}

TEST(CookieJar, RefusesACookieWithABitFlipped) {
  const CookieJar jar(kKey);
  const Cookie cookie = jar.give(kPeer, kEpoch, at(0s));
  for (std::size_t bit = 0; bit < 8 * cookie.size(); ++bit) {
    Cookie forged = cookie;
    forged[bit / 8] ^= static_cast<std::byte>(1u << (bit % 8));
    EXPECT_FALSE(jar.is_good(forged, kPeer, kEpoch, at(0s))) << "bit " << bit;
  }
}

// A cookie is good for at least one span, wherever in a span it was given, and never after two.
TEST(CookieJar, ExpiresCookies) {
  const CookieJar jar(kKey);
  for (Duration given = 0s; given < kCookieSpan; given += 700ms) {
    const Cookie cookie = jar.give(kPeer, kEpoch, at(given));
    for (Duration age = 0s; age <= kCookieSpan; age += 500ms) {
      EXPECT_TRUE(jar.is_good(cookie, kPeer, kEpoch, at(given + age)))
          << "given at " << given.count() << " ns, age " << age.count() << " ns";
    }
    for (Duration age = 2 * kCookieSpan; age <= 10 * kCookieSpan; age += 700ms) {
      EXPECT_FALSE(jar.is_good(cookie, kPeer, kEpoch, at(given + age)))
          << "given at " << given.count() << " ns, age " << age.count() << " ns";
    }
  }
}

TEST(CookieJar, WorksAtTimeZero) {
  const CookieJar jar(kKey);
  const Cookie cookie = jar.give(kPeer, kEpoch, time_from_ns(0));
  EXPECT_TRUE(jar.is_good(cookie, kPeer, kEpoch, time_from_ns(0)));
  EXPECT_FALSE(jar.is_good(cookie, kPeer, kEpoch, time_from_ns(0) + 2 * kCookieSpan));
}

}  // namespace
}  // namespace rtpm::wire
