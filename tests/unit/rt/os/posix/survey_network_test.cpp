#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <sys/socket.h>

#include "fake_host.hpp"
#include "rtpm/rt/network_survey.hpp"

namespace rtpm::rt {
namespace {

constexpr const char* kRouteHead =
    "Iface Destination Gateway Flags RefCnt Use Metric Mask MTU Window IRTT\n";

TEST(MulticastFacts, ListInterfacesAndTheMostSpecificRoute) {
  const FakeHost host;
  host.put("/sys/class/net/lo/flags", "0x9");
  host.put("/sys/class/net/eth0/flags", "0x1003");
  host.put("/sys/class/net/wlan0/flags", "0x1002");
  host.put("/proc/net/route", std::string(kRouteHead) +
                                  "eth0 00000000 010200C0 0003 0 0 0 00000000 0 0 0\n"
                                  "wlan0 000000EF 00000000 0001 0 0 0 000000FF 0 0 0\n"
                                  "down0 002AFFEF 00000000 0000 0 0 0 00FFFFFF 0 0 0");
  const MulticastFacts facts = read_multicast(host.root(), "239.255.42.1");
  ASSERT_EQ(facts.interfaces.size(), 3u);
  EXPECT_EQ(facts.interfaces[0], (InterfaceFacts{"eth0", true, false, true}));
  EXPECT_EQ(facts.interfaces[1], (InterfaceFacts{"lo", true, true, false}));
  EXPECT_EQ(facts.interfaces[2], (InterfaceFacts{"wlan0", false, false, true}));
  EXPECT_EQ(facts.route, "wlan0");
  EXPECT_EQ(read_multicast(host.root(), "224.0.0.1").route, "eth0") << "by the default route";
  EXPECT_EQ(read_multicast("/none", "239.255.42.1").route, "");
}

class Multicast : public testing::Test {
 protected:
  void expect_finding(Severity severity, const char* text, const char* remedy) const {
    const Finding finding = judge_multicast(facts_);
    EXPECT_EQ(finding.id, "multicast");
    EXPECT_EQ(finding.severity, severity) << finding.text;
    EXPECT_NE(finding.text.find(text), std::string::npos) << finding.text;
    EXPECT_NE(finding.remedy.find(remedy), std::string::npos) << finding.remedy;
    EXPECT_EQ(finding.cost.empty(), severity == Severity::kGood);
  }
  MulticastFacts facts_{.group = "239.255.42.1",
                        .interfaces = {{"lo", true, true, false}, {"eth0", true, false, true}},
                        .route = "eth0"};
};

TEST_F(Multicast, IsGoodIfItsTrialReturns) {
  expect_finding(Severity::kGood, "goes by eth0", "");
}

TEST_F(Multicast, NamesTheMissingRoute) {
  facts_.route = "";
  facts_.trial = MulticastTrial::kNotSent;
  expect_finding(Severity::kNote, "no route leads to 239.255.42.1",
                 "sudo ip route add 239.0.0.0/8 dev eth0");
  facts_.interfaces.pop_back();
  expect_finding(Severity::kNote, "no route", "dev lo");
}

TEST_F(Multicast, NamesAnInterfaceWithoutMulticast) {
  facts_.interfaces[1].has_multicast = false;
  expect_finding(Severity::kNote, "eth0, has multicast switched off",
                 "sudo ip link set dev eth0 multicast on");
}

TEST_F(Multicast, NamesAnInterfaceThatIsDown) {
  facts_.interfaces[1].is_up = false;
  expect_finding(Severity::kNote, "eth0, is down", "sudo ip link set dev eth0 up");
}

TEST_F(Multicast, ReportsARefusedUnsentOrLostTrial) {
  facts_.trial = MulticastTrial::kRefused;
  facts_.reason = "multicast group 239.255.42.1:7422 can't be used: No such device";
  expect_finding(Severity::kNote, "No such device", "see which system calls are allowed");
  // The same error has other causes, each with its own remedy.
  facts_.interfaces = {{"lo", true, true, false}};
  facts_.route = "";
  expect_finding(Severity::kNote, "no route", "sudo ip route add 239.0.0.0/8 dev lo");
  facts_.interfaces[0].is_up = false;
  expect_finding(Severity::kNote, "No such device", "sudo ip link set dev lo up");
  facts_.interfaces = {{"lo", true, true, false}, {"eth0", true, false, true}};
  facts_.route = "eth0";
  facts_.trial = MulticastTrial::kNotSent;
  expect_finding(Severity::kNote, "can't be sent", "nft list ruleset");
  facts_.trial = MulticastTrial::kNotReceived;
  expect_finding(Severity::kNote, "did not come back", "nft list ruleset");
}

TEST_F(Multicast, IsJudgedByItsTrialAloneWithoutAListOfInterfaces) {
  facts_.interfaces.clear();
  facts_.route = "";
  expect_finding(Severity::kGood, "comes back", "");
  facts_.trial = MulticastTrial::kNotReceived;
  expect_finding(Severity::kNote, "did not come back", "firewall");
  facts_.trial = MulticastTrial::kRefused;
  facts_.reason = "there is no network";
  expect_finding(Severity::kNote, "there is no network", "firewall");
}

TEST(PortHolders, AreFoundInTheSystemsTables) {
  const FakeHost host;
  const std::string head = "  sl  local_address rem_address   st ...\n";
  const std::string rest = " 00000000:00000000 00:00000000 00000000     0        0 ";
  host.put("/proc/net/udp", head + "1: 0100007F:1CFD 00000000:0000 07" + rest + "771 2 0 0 0\n" +
                                "2: 0100007F:1CFE 0100007F:0035 01" + rest + "773 2 0 0 0");
  host.put("/proc/net/tcp6", head +
                                 "1: 00000000000000000000000000000000:1CFC "
                                 "00000000000000000000000000000000:0000 0A" +
                                 rest + "772 1 0 0 0");
  host.put("/proc/90/comm", "nginx");
  host.link("/proc/90/fd/3", "socket:[772]");
  const auto tcp = holder_of_port(host.root(), 7420);
  ASSERT_TRUE(tcp);
  EXPECT_EQ(tcp->transport, "TCP");
  EXPECT_EQ(tcp->program, "nginx");
  EXPECT_EQ(tcp->process_id, 90);
  const auto udp = holder_of_port(host.root(), 7421);
  ASSERT_TRUE(udp);
  EXPECT_EQ(udp->transport, "UDP");
  EXPECT_EQ(udp->process_id, 0) << "another user's";
  EXPECT_FALSE(holder_of_port(host.root(), 7422)) << "it is connected to a peer";
}

TEST(PortHolders, IncludeThisProcess) {
  const int socket = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof address;
  ASSERT_EQ(::bind(socket, reinterpret_cast<sockaddr*>(&address), size), 0);
  ASSERT_EQ(::listen(socket, 1), 0);
  ASSERT_EQ(::getsockname(socket, reinterpret_cast<sockaddr*>(&address), &size), 0);
  const auto holder = holder_of_port("", ntohs(address.sin_port));
  ::close(socket);
  ASSERT_TRUE(holder);
  EXPECT_EQ(holder->process_id, ::getpid());
  EXPECT_EQ(holder->transport, "TCP");
}

TEST(Ports, AreFreeRtpmsOrHeldByAnotherProgram) {
  PortFacts facts{.port = 7420, .program = "rtpm-registryd", .option = "--port"};
  EXPECT_EQ(judge_port(facts).id, "port-7420");
  EXPECT_EQ(judge_port(facts).severity, Severity::kGood);
  EXPECT_EQ(judge_port(facts).text, "it is free for rtpm-registryd");
  facts.holder = PortHolder{"TCP", "nginx", 90};
  facts.answers = true;
  EXPECT_EQ(judge_port(facts).severity, Severity::kGood);
  facts.answers = false;
  const Finding held = judge_port(facts);
  EXPECT_EQ(held.severity, Severity::kWarning);
  EXPECT_NE(held.text.find("'nginx' (process 90) has it by TCP"), std::string::npos) << held.text;
  EXPECT_NE(held.cost.find("does not start there"), std::string::npos);
  EXPECT_EQ(held.remedy, "kill 90, or rtpm-registryd --port 8420");
  facts.holder = PortHolder{.transport = "UDP"};
  EXPECT_NE(judge_port(facts).text.find("another user"), std::string::npos);
  EXPECT_NE(judge_port(facts).remedy.find("sudo ss -lnptu 'sport = :7420'"), std::string::npos);
}

}  // namespace
}  // namespace rtpm::rt
