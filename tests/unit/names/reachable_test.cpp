#include "rtpm/names/reachable.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "servant/entries.hpp"

namespace rtpm::names {
namespace {

using transport::InterfaceAddress;
using transport::SocketAddress;

/// A host with two networks, and with the one of every host that runs containers.
std::vector<InterfaceAddress> own() {
  const auto at = [](const char* interface, const char* host, int prefix_size) {
    return InterfaceAddress{interface, *SocketAddress::parse(host, 0), prefix_size};
  };
  return {at("lo", "127.0.0.1", 8),        at("lo", "::1", 128),
          at("eth0", "10.0.0.7", 24),      at("eth1", "10.0.1.7", 24),
          at("eth0", "fd00:0:0:1::7", 64), at("docker0", "172.17.0.1", 16)};
}

std::string reached(const std::string& hosts, bool is_of_other_host) {
  const NameEntry entry{.name = "lab/arm0",
                        .url = "rtpm://" + hosts + ":4711/lab/arm0",
                        .interface = "lab.Arm",
                        .bound_from = "10.0.0.9",
                        .is_of_other_host = is_of_other_host};
  const auto url = reachable_url(entry, own());
  if (!url) return url.error().text();
  constexpr std::size_t kSchemeSize = 7;
  return url->substr(kSchemeSize, url->find(":4711") - kSchemeSize);
}

TEST(ReachableUrl, PrefersTheOwnAddressOnThisHost) {
  EXPECT_EQ(reached("10.9.0.1,10.0.1.7", false), "10.0.1.7,10.9.0.1");
  EXPECT_EQ(reached("10.9.0.1,127.0.0.1", false), "127.0.0.1,10.9.0.1");
  EXPECT_EQ(reached("10.0.0.7,[::1]", false), "10.0.0.7,[::1]") << "as they stand";
  EXPECT_EQ(reached("127.0.0.1", false), "127.0.0.1");
}

TEST(ReachableUrl, PrefersASharedNetworkOnAnotherHost) {
  EXPECT_EQ(reached("192.168.1.5,10.0.1.9", true), "10.0.1.9,192.168.1.5");
  EXPECT_EQ(reached("192.168.1.5,[fd00:0:0:1::9],robot.lab,10.0.0.9", true),
            "[fd00:0:0:1::9],10.0.0.9,192.168.1.5,robot.lab");
  EXPECT_EQ(reached("192.168.1.5,[2001:db8::9]", true), "192.168.1.5,[2001:db8::9]");
}

TEST(ReachableUrl, OmitsThisHostsAddressesForAnotherHost) {
  EXPECT_EQ(reached("172.17.0.1,10.0.0.9", true), "10.0.0.9");
  EXPECT_EQ(reached("127.0.0.1,10.0.0.9", true), "10.0.0.9");
  EXPECT_EQ(reached("172.17.0.1", true), "172.17.0.1") << "for want of others";
}

TEST(ReachableUrl, ReportsAnotherHostThatServesItselfOnly) {
  for (const char* hosts : {"127.0.0.1", "127.0.0.1,[::1]"}) {
    const std::string text = reached(hosts, true);
    for (const char* part :
         {"'lab/arm0' at rtpm://127.0.0.1", "on 10.0.0.9", "serves its own host only",
          "Remedy: start its server with --host any"})
      EXPECT_NE(text.find(part), text.npos) << part << " is not in: " << text;
  }
}

NameEntry entry_for(std::uint64_t bound_from, std::uint64_t asked_from) {
  flatbuffers::FlatBufferBuilder builder;
  builder.Finish(write_entry(
      builder, {.name = "a", .url = "rtpm://h:1/a", .interface = "A", .host = bound_from}, {},
      asked_from, EntryDetail::kHost));
  return entry_of(*flatbuffers::GetRoot<Entry>(builder.GetBufferPointer()));
}

TEST(NameEntry, StatesWhetherItsServerIsOnAnotherHost) {
  constexpr std::uint64_t kHere = 0x7f00'0001;
  constexpr std::uint64_t kThere = 0x0a00'0007;
  EXPECT_FALSE(entry_for(kHere, kHere).is_of_other_host);
  EXPECT_FALSE(entry_for(kHere, kHere + 1).is_of_other_host) << "all loopback is one host";
  EXPECT_TRUE(entry_for(kHere, kThere).is_of_other_host);
  EXPECT_TRUE(entry_for(kThere, kHere).is_of_other_host);
  EXPECT_FALSE(entry_for(kThere, kThere).is_of_other_host);
  EXPECT_FALSE(entry_for(0, kThere).is_of_other_host) << "it is not known";
  EXPECT_EQ(entry_for(kThere, kHere).bound_from, "10.0.0.7");
}

}  // namespace
}  // namespace rtpm::names
