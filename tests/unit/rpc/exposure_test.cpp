#include "security/exposure.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>

#include "rtpm/rt/clock.hpp"
#include "rtpm/test/temporary_folder.hpp"

namespace rtpm::rpc {
namespace {

transport::HostsToServe at(const std::string& hosts) {
  auto found = transport::hosts_to_serve(hosts, rt::now() + std::chrono::seconds{5});
  EXPECT_TRUE(found) << hosts;
  return found ? *found : transport::HostsToServe{};
}

/// An address of no host, so that nothing is opened there.
transport::HostsToServe at_another_address() {
  transport::HostsToServe hosts;
  hosts.addresses = {{"eth0", *transport::SocketAddress::parse("192.0.2.7", 0)}};
  return hosts;
}

class Exposure : public testing::Test {
 protected:
  Exposure() { ::setenv("RTPM_KEYS", folder_.c_str(), 1); }

  const rtpm::test::TemporaryFolder own_folder_;
  const std::string folder_ = own_folder_.path();
};

TEST_F(Exposure, OnLoopbackUsesGrantsOnlyIfTheyAreNamed) {
  std::ofstream(folder_ + "/authorized") << "uid:7 role=observe on=**\n";
  for (const char* hosts : {"127.0.0.1", "localhost", "127.0.0.2,127.0.0.3"}) {
    EXPECT_FALSE(is_for_other_hosts(at(hosts))) << hosts;
    EXPECT_EQ(*grants_file_of({}, at(hosts)), "") << hosts;
    EXPECT_EQ(*grants_file_of({.authorized_file = "grants"}, at(hosts)), "grants") << hosts;
  }
}

TEST_F(Exposure, ToOtherHostsRequiresGrantsOrAnOption) {
  for (const transport::HostsToServe& hosts : {at("any"), at_another_address()}) {
    EXPECT_TRUE(is_for_other_hosts(hosts));
    const auto refused = grants_file_of({}, hosts);
    ASSERT_FALSE(refused);
    for (const char* part : {"/authorized is not there", "rtpm key authorize 'rtpm25519",
                             "rtpm key learn", "--insecure"})
      EXPECT_NE(refused.error().text().find(part), std::string::npos) << refused.error().text();
    EXPECT_EQ(*grants_file_of({.is_insecure = true}, hosts), "");
    EXPECT_EQ(*grants_file_of({.authorized_file = "grants"}, hosts), "grants");
  }
  std::ofstream(folder_ + "/authorized") << "uid:7 role=observe on=**\n";
  EXPECT_EQ(*grants_file_of({}, at("any")), folder_ + "/authorized");
}

TEST(OpenWarning, IsPrintedAtOnceAndThenEachMinute) {
  OpenWarning warning("server 'rtpm-deviced'", "10.0.0.7:7500");
  const MonotonicTime begin = rt::now();
  testing::internal::CaptureStderr();
  EXPECT_EQ(warning.tick(begin), begin + OpenWarning::kInterval);
  EXPECT_EQ(warning.tick(begin + std::chrono::seconds{59}), begin + OpenWarning::kInterval);
  EXPECT_GT(warning.tick(begin + std::chrono::seconds{61}), begin + OpenWarning::kInterval);
  const std::string printed = testing::internal::GetCapturedStderr();
  EXPECT_EQ(std::ranges::count(printed, '\n'), 2) << printed;
  EXPECT_NE(printed.find("server 'rtpm-deviced' serves everybody who reaches 10.0.0.7:7500"),
            std::string::npos)
      << printed;
}

}  // namespace
}  // namespace rtpm::rpc
