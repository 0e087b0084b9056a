#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include "programs.hpp"
#include "rtpm/test/os.hpp"

// `rtpm` and servers without a registry's URL: on one host, and in networks of this test's own.
namespace rtpm::system_test {
namespace {

using Json = nlohmann::json;
using Words = std::vector<std::string>;

Words device_options(const std::string& name) {
  return {"--realtime",       "off", "--events",  "none", "--settings", "",
          "--flight-records", "",    "--devices", name};
}

/// Programs of one host that share only the folder of their sockets.
class WithoutRegistry : public testing::Test {
 protected:
  [[nodiscard]] static test::Process::End rtpm(const Words& arguments) {
    return run_program("rtpm", arguments);
  }
  /// Whether `rtpm list` shows exactly these names before patience is over.
  [[nodiscard]] static bool lists(const std::vector<std::string>& names) {
    return test::await([&] {
      const auto end = rtpm({"list", "--json"});
      const Json entries = Json::parse(end.output, nullptr, false);
      if (!entries.is_array() || entries.size() != names.size()) return names.empty();
      for (std::size_t i = 0; i < names.size(); ++i) {
        if (entries[i]["name"] != names[i]) return false;
      }
      return true;
    });
  }
};

TEST_F(WithoutRegistry, FindsNamesOfOneHostAsServersComeAndGo) {
  expect_one_sentence(rtpm({"list"}), 3, {"there are no names", "rtpm-registryd or a server"});
  const auto arm = start_daemon("rtpm-deviced", device_options("arm0"));
  auto gaze = start_daemon("rtpm-deviced", device_options("gaze0"));
  ASSERT_TRUE(arm && gaze);
  ASSERT_TRUE(lists({"lab/arm0", "lab/gaze0"}));
  EXPECT_EQ(rtpm({"resolve", "lab/arm0"}).output, arm->url + "\n");
  EXPECT_EQ(rtpm({"call", "lab/arm0", "read"}).exit_code, 0);
  EXPECT_EQ(rtpm({"ping", "lab/gaze0", "--count", "1"}).exit_code, 0);
  expect_text(rtpm({"find", "--where", "class == 'haptic'"}).output, {"lab/arm0"});
  expect_text(rtpm({"info", "lab/arm0", "--schema"}).output,
              {"rpc_service Device", "//   rate_hz = 1000.0 hertz"});
  const Json info = Json::parse(rtpm({"info", "lab/arm0", "--json"}).output, nullptr, false);
  EXPECT_EQ(info["properties"]["class"], "haptic");
  EXPECT_EQ(info["units"]["rate_hz"], "hertz");
  expect_text(rtpm({"watch", "--for", "100ms"}).output, {"bound  lab/arm0", "bound  lab/gaze0"});
  expect_one_sentence(rtpm({"bind", "lab/x", "rtpm://127.0.0.1:1/x", "--interface", "lab.X"}), 3,
                      {"only a registry takes names for others"});
  expect_one_sentence(rtpm({"list", "--registry", "rtpm://127.0.0.1:1/rtpm/names"}), 3,
                      {"no registry answers at rtpm://127.0.0.1:1/rtpm/names"});

  gaze->process.send_signal(SIGKILL);
  ASSERT_TRUE(lists({"lab/arm0"}));

  auto registry = start_daemon("rtpm-registryd", {"--port", "0", "--realtime", "off"});
  ASSERT_TRUE(registry);
  const auto listed_there = [&] {
    return rtpm({"list", "--registry", registry->url}).output.find("lab/arm0") != std::string::npos;
  };
  EXPECT_TRUE(test::await(listed_there)) << "the name moves to the registry";
  ASSERT_TRUE(lists({"lab/arm0"}));
  registry->process.send_signal(SIGKILL);
  ASSERT_TRUE(lists({"lab/arm0"})) << "the server serves its name itself again";
}

// A program that hangs costs searchers a share of their deadline, and is reported.
TEST_F(WithoutRegistry, DoesNotWaitForAServerThatHangs) {
  const auto arm = start_daemon("rtpm-deviced", device_options("arm0"));
  const auto gaze = start_daemon("rtpm-deviced", device_options("gaze0"));
  ASSERT_TRUE(arm && gaze);
  ASSERT_TRUE(lists({"lab/arm0", "lab/gaze0"}));
  gaze->process.stop();
  const auto end = rtpm({"list"});
  EXPECT_EQ(end.exit_code, 0);
  expect_text(end.output, {"lab/arm0"});
  expect_text(end.errors, {"no name service answers at"});
}

TEST_F(WithoutRegistry, DoesNotWaitForARegistryThatHangs) {
  const auto registry = start_daemon("rtpm-registryd", {"--port", "0", "--realtime", "off"});
  ASSERT_TRUE(registry);
  registry->process.stop();
  const auto arm = start_daemon("rtpm-deviced", device_options("arm0"));
  ASSERT_TRUE(arm);
  ASSERT_TRUE(lists({"lab/arm0"}));
  EXPECT_EQ(rtpm({"call", "lab/arm0", "read"}).exit_code, 0);
}

TEST_F(WithoutRegistry, ReportsItsFindingsInDoctor) {
  const auto arm = start_daemon("rtpm-deviced", device_options("arm0"));
  ASSERT_TRUE(arm);
  const Json report =
      Json::parse(rtpm({"doctor", "--quick", "--json"}).output, nullptr, false)["findings"];
  std::string text = report.dump();
  expect_text(text, {"discovery-folder", "1 name service", "discovery (host) finds 1 name service",
                     "all 1 names"});
}

/// Hosts a and b in this test's own LAN, and c behind a router that does not forward multicast.
class OnTheLan : public testing::Test {
 protected:
  void SetUp() override {
    if (geteuid() != 0) GTEST_SKIP() << "networks of its own take root";
    for (const char* const host : {"a", "b", "c"}) {
      if (!ip({"netns", "add", space(host)})) GTEST_SKIP() << "no network namespaces here";
      ASSERT_TRUE(ip({"-n", space(host), "link", "set", "lo", "up"}));
    }
    join("a", "eth0", "10.77.1.1/24", "b", "eth0", "10.77.1.2/24");
    join("b", "eth1", "10.77.2.1/24", "c", "eth0", "10.77.2.2/24");
    ASSERT_TRUE(ip({"-n", space("a"), "route", "add", "default", "via", "10.77.1.2"}));
    ASSERT_TRUE(ip({"-n", space("c"), "route", "add", "default", "via", "10.77.2.1"}));
    ASSERT_TRUE(run(
        {"ip", "netns", "exec", space("b"), "sh", "-c", "echo 1 > /proc/sys/net/ipv4/ip_forward"}));
  }
  void TearDown() override {
    for (const char* const host : {"a", "b", "c"})
      static_cast<void>(ip({"netns", "delete", space(host)}));
  }

  [[nodiscard]] static bool run(const Words& command) {
    const auto end = test::run(command, kPatience);
    return end && end->exit_code == 0;
  }
  [[nodiscard]] static bool ip(Words arguments) {
    arguments.insert(arguments.begin(), "ip");
    return run(arguments);
  }
  [[nodiscard]] static std::string space(const std::string& host) {
    return "rtpm-" + std::to_string(getpid()) + "-" + host;
  }
  static void join(const std::string& one, const std::string& device, const std::string& address,
                   const std::string& other, const std::string& other_device,
                   const std::string& other_address) {
    ASSERT_TRUE(ip({"-n", space(one), "link", "add", device, "type", "veth", "peer", "name",
                    other_device, "netns", space(other)}));
    for (const auto& [host, link, at] :
         {std::tuple(one, device, address), std::tuple(other, other_device, other_address)}) {
      ASSERT_TRUE(ip({"-n", space(host), "address", "add", at, "dev", link}));
      ASSERT_TRUE(ip({"-n", space(host), "link", "set", link, "up"}));
    }
  }
  [[nodiscard]] static Words command(const std::string& host, const std::string& program,
                                     const Words& arguments) {
    Words words{"ip", "netns", "exec", space(host), path_of(program)};
    words.insert(words.end(), arguments.begin(), arguments.end());
    if (program != "rtpm") words.emplace_back("--insecure");
    return words;
  }
  [[nodiscard]] static test::Process::End rtpm_on(const std::string& host, const Words& arguments) {
    return test::run(command(host, "rtpm", arguments), kPatience).value_or(test::Process::End{});
  }
  /// Starts a device server; it has printed its addresses.
  [[nodiscard]] static test::Process device_on(const std::string& host, Words arguments) {
    const Words others = device_options("arm0");
    arguments.insert(arguments.end(), others.begin(), others.end());
    test::Process server(command(host, "rtpm-deviced", arguments));
    EXPECT_TRUE(server.wait_for_output("rtpm://", kPatience)) << server.errors();
    return server;
  }
};

TEST_F(OnTheLan, FindsAServerInItsDomainOnly) {
  test::Process server = device_on("b", {"--host", "10.77.1.2", "--discover", "lan:7@eth0"});
  EXPECT_TRUE(server.wait_for_errors(
      "discovery: domain 7 on eth0 (10.77.1.2), group 239.255.43.7:7423", kPatience))
      << server.errors();
  const auto found = rtpm_on("a", {"list", "--discover", "lan:7@eth0"});
  expect_text(found.output, {"lab/arm0", "rtpm://10.77.1.2:"});
  expect_text(found.errors, {"discovery: domain 7 on eth0 (10.77.1.1)"});
  EXPECT_EQ(rtpm_on("a", {"call", "lab/arm0", "read", "--discover", "lan:7@any"}).exit_code, 0);
  expect_text(rtpm_on("a", {"watch", "--for", "200ms", "--discover", "lan:7@eth0"}).output,
              {"bound  lab/arm0"});
  EXPECT_EQ(rtpm_on("a", {"list"}).exit_code, 3) << "the default is this host";
  const auto other = rtpm_on("a", {"list", "--discover", "lan:8@eth0"});
  EXPECT_EQ(other.exit_code, 3);
  expect_text(other.errors, {"there are no names", "this host or the LAN"});
  expect_text(rtpm_on("a", {"list", "--discover", "lan:7@eth9"}).errors,
              {"no interface 'eth9'", "it has eth0 (10.77.1.1)"});
  expect_text(rtpm_on("a", {"doctor", "--quick", "--json", "--discover", "lan:7@eth0"}).output,
              {"eth0 (10.77.1.1) sends multicast", "and 1 on the LAN"});
}

// A duplicate name never resolves silently.
TEST_F(OnTheLan, RefusesANameOfTwoHosts) {
  const test::Process first = device_on("b", {"--host", "10.77.1.2", "--discover", "lan:7@eth0"});
  test::Process second = device_on("a", {"--host", "10.77.1.1", "--discover", "lan:7@eth0"});
  EXPECT_TRUE(second.wait_for_errors("bound twice", kPatience)) << second.errors();
  const auto end = rtpm_on("a", {"resolve", "lab/arm0", "--discover", "lan:7@eth0"});
  EXPECT_NE(end.exit_code, 0);
  expect_text(end.errors, {"the name 'lab/arm0' is bound twice", "rtpm://10.77.1.1:",
                           "rtpm://10.77.1.2:", "host 10.77.1.2", "of this host"});
  const auto listed = rtpm_on("a", {"list", "--discover", "lan:7@eth0"});
  expect_text(listed.output, {"rtpm://10.77.1.1:", "rtpm://10.77.1.2:", "(bound twice)"});
}

TEST_F(OnTheLan, FindsServersByAListOfHostsWithoutMulticast) {
  const test::Process server = device_on("c", {"--host", "10.77.2.2", "--discover", "lan:7@eth0"});
  EXPECT_EQ(rtpm_on("a", {"list", "--discover", "lan:7@eth0"}).exit_code, 3);
  expect_text(rtpm_on("a", {"list", "--discover", "10.77.2.2"}).output,
              {"lab/arm0", "rtpm://10.77.2.2:"});
  EXPECT_EQ(
      rtpm_on("a", {"call", "lab/arm0", "read", "--discover", "10.77.1.2,10.77.2.2"}).exit_code, 0);
}

// The server registers names that lead to its own loopback address.
TEST_F(OnTheLan, ReportsAndLeavesOutUnreachableNames) {
  test::Process registry(
      command("b", "rtpm-registryd",
              {"--host", "10.77.1.2", "--realtime", "off", "--discover", "lan@eth0"}));
  ASSERT_TRUE(registry.wait_for_output("rtpm://", kPatience)) << registry.errors();
  const test::Process server = device_on("b", {});
  const auto end = rtpm_on("a", {"list", "--discover", "lan@eth0"});
  EXPECT_EQ(end.output, "");
  expect_text(end.errors, {"'lab/arm0'", "leads to that host's own", "--host"});
  expect_text(rtpm_on("a", {"list", "--discover", "10.77.1.2:7420"}).errors, {"'lab/arm0'"});
}

}  // namespace
}  // namespace rtpm::system_test
