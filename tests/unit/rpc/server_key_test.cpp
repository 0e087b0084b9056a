#include "rtpm/rpc/server_key.hpp"

#include <gtest/gtest.h>

#include <atomic>

#include "rtpm/rpc/error.hpp"
#include "rtpm/rpc/server.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/test/hello_responder.hpp"

namespace rtpm::rpc {
namespace {

using test::HelloResponder;
using test::sealed_cookie;

constexpr Duration kPatience = std::chrono::seconds{20};

TEST(ServerKey, IsReadFromTheCookie) {
  const HelloResponder server([](ConstBytes hello) { return sealed_cookie(hello, 7, 0); });
  const auto key = ask_server_key("127.0.0.1", server.port(), rt::now() + kPatience);
  ASSERT_TRUE(key) << key.error().text();
  EXPECT_EQ(key->front(), std::byte{7});
}

TEST(ServerKey, IsNotReadFromAnswersToOthers) {
  std::atomic<int> count = 0;
  const HelloResponder server([&](ConstBytes hello) {
    const bool is_other = ++count < 3;
    return is_other ? sealed_cookie(hello, 1, 1) : sealed_cookie(hello, 2, 0);
  });
  const auto key = ask_server_key("127.0.0.1", server.port(), rt::now() + kPatience);
  ASSERT_TRUE(key) << key.error().text();
  EXPECT_EQ(key->front(), std::byte{2});
}

TEST(ServerKey, IsMissingAtAServerWithoutSealedSessions) {
  auto server = Server::create({.lanes = {{}}, .realtime = rt::RealtimeMode::kOff});
  ASSERT_TRUE(server);
  ASSERT_TRUE((*server)->start());
  const auto key = ask_server_key("127.0.0.1", (*server)->port(), rt::now() + kPatience);
  ASSERT_FALSE(key);
  EXPECT_NE(key.error().text().find("has no sealed sessions"), std::string::npos)
      << key.error().text();
}

TEST(ServerKey, IsMissingIfNoServerAnswers) {
  const HelloResponder silent([](ConstBytes) { return HelloResponder::Bytes(); });
  auto key = ask_server_key("127.0.0.1", silent.port(), rt::now() + std::chrono::milliseconds{50});
  ASSERT_FALSE(key);
  EXPECT_EQ(key.error().cause, CallError::kUnreachable);
  key = ask_server_key("127.0.0.1", 1, rt::now() + kPatience);
  ASSERT_FALSE(key);
  EXPECT_NE(key.error().text().find("no program has this port"), std::string::npos)
      << key.error().text();
}

}  // namespace
}  // namespace rtpm::rpc
