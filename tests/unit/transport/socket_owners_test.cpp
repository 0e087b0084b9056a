#include <gtest/gtest.h>

#include <vector>

#include "rtpm/transport/socket_users.hpp"
#include "rtpm/transport/tcp.hpp"

// On Windows, where users have no numbers.
namespace rtpm::transport {
namespace {

TEST(SocketOwners, IncludeThisUser) {
  const auto tcp = TcpListener::open("127.0.0.1", 0);
  ASSERT_TRUE(tcp);
  const auto users = users_at(*SocketAddress::parse("127.0.0.1", tcp->port()));
  if (!users) GTEST_SKIP() << "wine does not tell whose process has a port";
  ASSERT_EQ(users->size(), 1u);
  EXPECT_EQ(users->front(), 0u);
}

TEST(SocketOwners, AreTrustedIfTheyAreThisUserOrNamed) {
  EXPECT_TRUE(is_trusted_user(0, {}));
  EXPECT_FALSE(is_trusted_user(1002, {}));
  const std::vector<std::uint32_t> others{1002};
  EXPECT_TRUE(is_trusted_user(1002, others));
}

}  // namespace
}  // namespace rtpm::transport
