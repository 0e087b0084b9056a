#include "rtpm/transport/socket_users.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdint>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include "proc_net.hpp"
#include "rtpm/transport/tcp.hpp"
#include "rtpm/transport/udp.hpp"

// The users whose sockets receive at an address.
namespace rtpm::transport {
namespace {

using Users = std::vector<std::uint32_t>;

constexpr const char* kTcp =
    "  sl  local_address rem_address   st tx_queue rx_queue tr tm->when retrnsmt   uid  timeout\n"
    "   0: 0100007F:1CFC 00000000:0000 0A 00000000:00000000 00:00000000 00000000  1001        0 1\n"
    "   1: 00000000:1CFD 00000000:0000 0A 00000000:00000000 00:00000000 00000000  1002        0 2\n"
    "   2: 0200007F:1CFC 00000000:0000 0A 00000000:00000000 00:00000000 00000000  1003        0 3\n"
    "   3: 0100007F:1CFC 0100007F:9999 01 00000000:00000000 00:00000000 00000000  1004        0 "
    "4\n";
constexpr const char* kUdp6 =
    "  sl  local_address                         remote_address                        st ...\n"
    "  10: 00000000000000000000000000000000:1CFC 00000000000000000000000000000000:0000 07 "
    "00000000:00000000 00:00000000 00000000  1005        0 5 2 0 0\n"
    "  11: 0000000000000000FFFF00000100007F:1CFD 00000000000000000000000000000000:0000 07 "
    "00000000:00000000 00:00000000 00000000  1006        0 6 2 0 0\n"
    "  12: 00000000000000000000000001000000:1CFE 00000000000000000000000000000000:0000 07 "
    "00000000:00000000 00:00000000 00000000  1007        0 7 2 0 0\n"
    "  13: 00000000000000000000000001000000:1CFE 00000000000000000000000001000000:0001 01 "
    "00000000:00000000 00:00000000 00000000  1008        0 8 2 0 0\n"
    "  14: 0000000 nonsense 07\n";

Users users_in(const char* table, bool is_tcp, const std::string& host, std::uint16_t port) {
  std::istringstream text(table);
  return users_in_table(text, is_tcp, *SocketAddress::parse(host, port));
}

TEST(SocketUsers, AreFoundByAddressOrWildcard) {
  EXPECT_EQ(users_in(kTcp, true, "127.0.0.1", 7420), Users{1001}) << "no connection counts";
  EXPECT_EQ(users_in(kTcp, true, "127.0.0.2", 7420), Users{1003});
  EXPECT_EQ(users_in(kTcp, true, "127.0.0.1", 7421), Users{1002});
  EXPECT_EQ(users_in(kTcp, true, "::1", 7421), Users{});
  EXPECT_EQ(users_in(kTcp, true, "127.0.0.1", 7422), Users{});
  EXPECT_EQ(users_in(kUdp6, false, "127.0.0.1", 7420), Users{1005}) << "'::' may take IPv4, too";
  EXPECT_EQ(users_in(kUdp6, false, "127.0.0.1", 7421), Users{1006});
  EXPECT_EQ(users_in(kUdp6, false, "::1", 7422), Users{1007});
  EXPECT_EQ(users_in("", false, "::1", 7422), Users{});
}

TEST(SocketUsers, AreFoundInTheSystem) {
  const auto tcp = TcpListener::open("127.0.0.1", 0);
  ASSERT_TRUE(tcp);
  const auto address = SocketAddress::parse("127.0.0.1", tcp->port());
  EXPECT_EQ(users_at(*address), std::optional(Users{geteuid()}));
  const auto udp = UdpPort::open({.host = "127.0.0.1", .port = tcp->port()});
  ASSERT_TRUE(udp);
  EXPECT_EQ(users_at(*address), std::optional(Users{geteuid()})) << "each once";
  // There is no server at port 1.
  EXPECT_EQ(users_at(*SocketAddress::parse("127.0.0.1", 1)), std::optional(Users{}));
}

TEST(SocketUsers, AreTrustedIfOwnRootOrListed) {
  EXPECT_TRUE(is_trusted_user(geteuid(), {}));
  EXPECT_TRUE(is_trusted_user(0, {}));
  const Users others{1001};
  EXPECT_TRUE(is_trusted_user(1001, others));
  EXPECT_FALSE(is_trusted_user(1002, others));
}

}  // namespace
}  // namespace rtpm::transport
