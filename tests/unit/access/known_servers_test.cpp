#include "rtpm/access/known_servers.hpp"

#include <gtest/gtest.h>

#include "keys.hpp"

namespace rtpm::access {
namespace {

TEST(KnownServers, AreFoundByHostAndPort) {
  const KnownServers known = parse_known_servers(
      "# pinned\nrobot " + text_of(1) + "\nrobot:7420 " + text_of(2) + " # its registry\n" +
      "[fd00::4]:7420 " + text_of(3) + "\n[fd00::5] " + text_of(4) + "\n");
  EXPECT_TRUE(known.faults.empty());
  const auto registry = known.find("robot", 7420);
  ASSERT_EQ(registry.size(), 2U);
  EXPECT_EQ(registry[0].key, key_of(2));
  EXPECT_EQ(registry[0].line, 3U);
  EXPECT_EQ(registry[1].key, key_of(1));
  ASSERT_EQ(known.find("robot", 4711).size(), 1U);
  ASSERT_EQ(known.find("fd00::4", 7420).size(), 1U);
  EXPECT_TRUE(known.find("fd00::4", 1).empty());
  EXPECT_EQ(known.find("fd00::5", 1).size(), 1U);
  EXPECT_TRUE(known.find("other", 7420).empty());
}

TEST(KnownServers, NameUsersOfThisHostWhoseServersAreTrusted) {
  const KnownServers known = parse_known_servers("local uid:1001 # the cell\nlocal " + text_of(1) +
                                                 "\nlocal uid:65534\nlocal uid:x\nlocal uid:7 8\n");
  EXPECT_EQ(known.local_users, std::vector<std::uint32_t>{1001});
  EXPECT_EQ(known.find("local", 1).size(), 1U) << "a host of that name";
  ASSERT_EQ(known.faults.size(), 3U);
  EXPECT_EQ(known.faults[0].line, 3U);
  EXPECT_EQ(known.faults[0].column, 7U);
  EXPECT_EQ(known.faults[2].column, 13U);
}

TEST(KnownServers, AreReadAsWritten) {
  for (const KnownServer& server :
       {KnownServer{"robot", 7420, key_of(1), 1}, KnownServer{"fd00::4", 7420, key_of(2), 1},
        KnownServer{"10.0.0.1", 0, key_of(3), 1}}) {
    const KnownServers read = parse_known_servers(to_line(server));
    ASSERT_EQ(read.servers.size(), 1U) << to_line(server);
    EXPECT_EQ(read.servers[0], server);
  }
}

TEST(KnownServers, KeepTheOtherLinesOfAFaultyFile) {
  const KnownServers known = parse_known_servers(
      "robot\nrobot:0 " + text_of(1) + "\nrobot:70000 " + text_of(1) + "\n[fd00::4 " + text_of(1) +
      "\nrobot rtpm25519 short\nrobot " + text_of(1) + " more\nrobot " + text_of(1) + "\n");
  EXPECT_EQ(known.servers.size(), 1U);
  ASSERT_EQ(known.faults.size(), 6U);
  EXPECT_EQ(known.faults[0].column, 6U);
  EXPECT_EQ(known.faults[1].column, 1U);
  EXPECT_EQ(known.faults[4].column, 17U);
  EXPECT_EQ(known.faults[5].line, 6U);
}

}  // namespace
}  // namespace rtpm::access
