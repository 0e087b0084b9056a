#include <gtest/gtest.h>

#include <winsock2.h>

#include <algorithm>
#include <cstdint>
#include <string>
#include <utility>

#include "os/windows/windows_survey.hpp"
#include "rtpm/rt/network_survey.hpp"
#include "rtpm/rt/survey.hpp"

namespace rtpm::rt {
namespace {

WindowsFacts good_facts() {
  WindowsFacts facts;
  facts.memory_lock = "the system keeps some";
  facts.responsiveness = 10;
  facts.packets_per_ms = std::nullopt;
  facts.usable_cpu_count = 8;
  facts.power = PowerScheme::kPerformance;
  facts.clock_frequency = 10'000'000;
  facts.has_fine_timers = true;
  facts.is_clock_synchronised = true;
  facts.free_commit = std::uint64_t{8} << 30;
  return facts;
}

/// The finding, which has a cost and a remedy unless it is good or only unknown.
void expect_finding(const WindowsFacts& facts, const std::string& id, Severity severity,
                    const std::string& text, const std::string& remedy = "") {
  const std::vector<Finding> all = judge_windows(facts);
  const auto found = std::ranges::find(all, id, &Finding::id);
  ASSERT_NE(found, all.end()) << id;
  EXPECT_EQ(found->severity, severity) << found->text;
  EXPECT_NE(found->text.find(text), std::string::npos) << found->text;
  EXPECT_NE(found->remedy.find(remedy), std::string::npos) << found->remedy;
  EXPECT_EQ(found->remedy.empty(), remedy.empty()) << found->remedy;
  EXPECT_EQ(found->cost.empty(), remedy.empty()) << found->cost;
}

TEST(WindowsSurvey, FindsNothingOnAGoodHost) {
  for (const Finding& finding : judge_windows(good_facts()))
    EXPECT_EQ(finding.severity, Severity::kGood) << finding.id << ": " << finding.text;
}

TEST(WindowsSurvey, SaysWhatCostsLatencyAndWhatToDo) {
  WindowsFacts facts = good_facts();
  facts.realtime_refusal = SetupError{"no MMCSS", "", "sc start MMCSS"};
  facts.memory_lock_refusal = SetupError{"memory can't be locked", "", "secpol.msc"};
  facts.responsiveness = 20;
  facts.packets_per_ms = 10;
  facts.is_virtual_machine = true;
  facts.usable_cpu_count = 1;
  facts.power = PowerScheme::kOther;
  facts.clock_frequency = 14'318'180;
  facts.has_fine_timers = false;
  facts.is_clock_synchronised = false;
  facts.has_firewall = true;
  facts.sleeps_after_s = 1800;
  facts.free_commit = 100 * 1024 * 1024;
  expect_finding(facts, "realtime", Severity::kWarning, "no MMCSS", "sc start MMCSS");
  expect_finding(facts, "memory-lock", Severity::kProblem, "can't be locked", "secpol.msc");
  expect_finding(facts, "throttling", Severity::kNote, "20 %", "SystemResponsiveness");
  expect_finding(facts, "network-throttling", Severity::kNote, "10 packets", "0xffffffff");
  expect_finding(facts, "machine", Severity::kNote, "virtual", "host");
  expect_finding(facts, "cpus", Severity::kWarning, "1 CPU", "affinity");
  expect_finding(facts, "power", Severity::kWarning, "saves energy", "powercfg");
  expect_finding(facts, "clock", Severity::kWarning, "14318180 Hz", "bcdedit");
  expect_finding(facts, "timers", Severity::kProblem, "15.6 ms", "1803");
  expect_finding(facts, "clock-sync", Severity::kNote, "no service", "w32time");
  expect_finding(facts, "firewall", Severity::kNote, "is on", "netsh advfirewall");
  expect_finding(facts, "sleep", Severity::kWarning, "30 min", "powercfg /change");
  expect_finding(facts, "memory", Severity::kProblem, "100 MiB", "page file");
  facts.power = PowerScheme::kUnknown;
  expect_finding(facts, "power", Severity::kNote, "does not tell");
}

TEST(WindowsSurvey, ReadsThisHost) {
  const WindowsFacts facts = read_windows();
  EXPECT_FALSE(facts.memory_lock_refusal);
  EXPECT_NE(facts.memory_lock.find("MiB"), std::string::npos) << facts.memory_lock;
  EXPECT_GT(facts.clock_frequency, 1'000'000);
  EXPECT_GE(facts.usable_cpu_count, 1);
  EXPECT_GT(facts.free_commit, 0u);
  EXPECT_EQ(survey_host().size(), judge_windows(facts).size());
}

class Socket {
 public:
  explicit Socket(int type) {
    WSADATA data{};
    EXPECT_EQ(WSAStartup(MAKEWORD(2, 2), &data), 0);
    socket_ = socket(AF_INET, type, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    int size = sizeof address;
    EXPECT_EQ(bind(socket_, reinterpret_cast<sockaddr*>(&address), size), 0);
    if (type == SOCK_STREAM) {
      EXPECT_EQ(listen(socket_, 1), 0);
    }
    EXPECT_EQ(getsockname(socket_, reinterpret_cast<sockaddr*>(&address), &size), 0);
    port_ = ntohs(address.sin_port);
  }
  ~Socket() {
    closesocket(socket_);
    WSACleanup();
  }
  [[nodiscard]] std::uint16_t port() const noexcept { return port_; }

 private:
  SOCKET socket_ = INVALID_SOCKET;
  std::uint16_t port_ = 0;
};

TEST(PortHolders, IncludeThisProcess) {
  for (const auto& [type, transport] : {std::pair{SOCK_DGRAM, "UDP"}, {SOCK_STREAM, "TCP"}}) {
    std::uint16_t port = 0;
    {
      const Socket socket(type);
      port = socket.port();
      const auto holder = holder_of_port("", port);
      ASSERT_TRUE(holder) << transport;
      EXPECT_EQ(holder->transport, transport);
      // Wine names no owners.
      if (holder->process_id != 0) {
        EXPECT_EQ(holder->process_id, static_cast<int>(GetCurrentProcessId()));
        EXPECT_EQ(holder->program, "rt_test.exe");
      }
    }
    EXPECT_FALSE(holder_of_port("", port));
  }
}

TEST(Ports, AreFreedByCommandsOfThisSystem) {
  PortFacts facts{.port = 7420, .program = "rtpm-registryd", .option = "--port"};
  facts.holder = PortHolder{"TCP", "nginx", 90};
  EXPECT_EQ(judge_port(facts).remedy, "taskkill /F /PID 90, or rtpm-registryd --port 8420");
  facts.holder = PortHolder{.transport = "UDP"};
  EXPECT_NE(judge_port(facts).remedy.find("netstat"), std::string::npos);
}

TEST(Multicast, IsJudgedByItsTrial) {
  MulticastFacts facts = read_multicast("", "239.255.42.1");
  EXPECT_EQ(judge_multicast(facts).severity, Severity::kGood);
  facts.trial = MulticastTrial::kNotReceived;
  EXPECT_EQ(judge_multicast(facts).severity, Severity::kNote);
  EXPECT_EQ(judge_multicast(facts).remedy.find("sudo"), std::string::npos);
}

}  // namespace
}  // namespace rtpm::rt
