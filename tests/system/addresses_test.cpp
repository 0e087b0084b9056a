#include <gtest/gtest.h>
#include <signal.h>

#include <atomic>
#include <cstdio>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "network_host.hpp"
#include "programs.hpp"
#include "rtpm/gvd/client.hpp"
#include "rtpm/names/resolver.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/test/os.hpp"

// Hosts, as network namespaces: servers that move from one to another, and that have several
// addresses.
namespace rtpm::system_test {
namespace {

using namespace std::chrono_literals;

std::string registry_at(const std::string& host) {
  return "rtpm://" + host + ":7420/rtpm/names";
}

/// Reads a device by its name 100 times a second from a host, on a thread of its own.
class Caller {
 public:
  Caller(const Host& host, const std::string& registry)
      : thread_([this, &host, registry] { run(host, registry); }) {}
  ~Caller() { finish(); }
  Caller(const Caller&) = delete;
  Caller& operator=(const Caller&) = delete;

  /// Whether this many more calls succeed in time.
  [[nodiscard]] bool succeeds(int more) {
    const int aim = good_count_ + more;
    return test::await([&] { return good_count_ >= aim; });
  }
  void finish() {
    is_ending_ = true;
    if (thread_.joinable()) thread_.join();
  }
  /// Reports the results; to be called after finish().
  void report(const std::string& title) const {
    int failed_count = 0;
    for (const auto& [reason, count] : failures_) {
      EXPECT_FALSE(reason.empty()) << "a failed call without a reason";
      failed_count += count;
    }
    const double outage_s = std::chrono::duration<double>(longest_outage_).count();
    std::printf("%s: %d calls, %d failed, longest outage %.2f s\n", title.c_str(),
                good_count_ + failed_count, failed_count, outage_s);
    for (const auto& [reason, count] : failures_)
      std::printf("  %d: %s\n", count, reason.c_str());
    EXPECT_GT(failed_count, 0) << "nothing was tried: the server was never away";
  }
  [[nodiscard]] const std::vector<std::string>& urls() const { return urls_; }

 private:
  void run(const Host& host, const std::string& registry) {
    host.enter();
    rpc::Node node({.wait = {.strategy = rt::WaitStrategy::kBlock}});
    names::RegistryResolver resolver(node, registry);
    node.use(resolver);
    auto arm = gvd::DeviceClient::open(node, "lab/arm0", {.bind = {.deadline = kPatience}});
    ASSERT_TRUE(arm) << arm.error().text();
    MonotonicTime last_good = rt::now();
    for (MonotonicTime next = rt::now(); !is_ending_; next += 10ms) {
      rt::sleep_until(next);
      const auto sample = arm->read({.deadline = 100ms});
      const MonotonicTime now = rt::now();
      next = std::max(next, now - 10ms);
      if (!sample) {
        ++failures_[std::string(gvd::to_string(sample.error()))];
        continue;
      }
      longest_outage_ = std::max(longest_outage_, now - last_good);
      last_good = now;
      if (const std::string url = arm->url(); urls_.empty() || urls_.back() != url) {
        urls_.push_back(url);
      }
      ++good_count_;
    }
  }

  std::atomic<int> good_count_{0};
  std::atomic<bool> is_ending_{false};
  std::map<std::string, int> failures_{};
  std::vector<std::string> urls_{};  ///< The URLs that the calls used, in order.
  Duration longest_outage_{};
  std::thread thread_;
};

/// Addresses of the three hosts of a network.
struct Network {
  const char* title;
  const char* registry;
  const char* first;
  const char* second;
  const char* caller;
  int prefix_size;
};

void PrintTo(const Network& network, std::ostream* out) {
  *out << network.title;
}

std::string in_url(const std::string& host) {
  return host.find(':') == std::string::npos ? host : "[" + host + "]";
}

class MovedServer : public testing::TestWithParam<Network> {
 protected:
  void SetUp() override {
    const std::string missing = missing_for_hosts();
    if (!missing.empty()) GTEST_SKIP() << missing;
    middle_.emplace("m");
    middle_->run("link add bridge type bridge");
    middle_->use("bridge", with_size(GetParam().registry));
    first_.emplace("a");
    second_.emplace("b");
    caller_.emplace("c");
    join(*first_, "port1", GetParam().first);
    join(*second_, "port2", GetParam().second);
    join(*caller_, "port3", GetParam().caller);
    registry_ = middle_->start("rtpm-registryd", {"--host", GetParam().registry, "--insecure"});
    ASSERT_TRUE(registry_);
  }
  static std::string with_size(const std::string& address) {
    return address + "/" + std::to_string(GetParam().prefix_size);
  }
  void join(const Host& host, const std::string& interface, const std::string& address) {
    host.join("eth0", with_size(address), *middle_, interface, "");
    middle_->run("link set " + interface + " master bridge");
  }
  [[nodiscard]] static std::string registry_url() {
    return registry_at(in_url(GetParam().registry));
  }
  [[nodiscard]] static std::optional<Daemon> start_arm(const Host& host) {
    return host.start("rtpm-deviced",
                      {"--host", "any", "--insecure", "--registry", registry_url()});
  }

  std::optional<Host> middle_, first_, second_, caller_;
  std::optional<Daemon> registry_;
};

// The client of a server whose address changes goes on by itself.
TEST_P(MovedServer, IsFollowedByAClientThatCallsIt) {
  auto arm = start_arm(*first_);
  ASSERT_TRUE(arm);
  Caller caller(*caller_, registry_url());
  ASSERT_TRUE(caller.succeeds(50));
  arm->process.send_signal(SIGKILL);
  ASSERT_TRUE(arm->process.wait(kPatience));
  // The new server waits for the lease of the server that died.
  arm = start_arm(*second_);
  ASSERT_TRUE(arm);
  EXPECT_TRUE(caller.succeeds(50)) << "after kill -9";
  arm->process.send_signal(SIGTERM);
  ASSERT_TRUE(arm->process.wait(kPatience));
  arm = start_arm(*first_);
  ASSERT_TRUE(arm);
  EXPECT_TRUE(caller.succeeds(50)) << "after an orderly end";
  caller.finish();
  caller.report(GetParam().title);
  ASSERT_EQ(caller.urls().size(), 3u);
  const std::string first = "rtpm://" + in_url(GetParam().first) + ":";
  EXPECT_TRUE(caller.urls()[0].starts_with(first)) << caller.urls()[0];
  EXPECT_TRUE(caller.urls()[1].starts_with("rtpm://" + in_url(GetParam().second) + ":"));
  EXPECT_TRUE(caller.urls()[2].starts_with(first));
}

INSTANTIATE_TEST_SUITE_P(
    Networks, MovedServer,
    testing::Values(Network{"ipv4", "10.77.0.1", "10.77.0.2", "10.77.0.3", "10.77.0.4", 24},
                    Network{"ipv6", "fd77::1", "fd77::2", "fd77::3", "fd77::4", 64}),
    [](const auto& instance) { return std::string(instance.param.title); });

/// A host with the registry and the device, and three networks with a caller each.
class ServerOfThreeNetworks : public testing::Test {
 protected:
  struct Link {
    std::string server;
    std::string caller;
    int prefix_size;
  };
  inline static const std::vector<Link> kLinks{
      {"10.78.1.1", "10.78.1.2", 24}, {"10.78.2.1", "10.78.2.2", 24}, {"fd78::1", "fd78::2", 64}};

  void SetUp() override {
    const std::string missing = missing_for_hosts();
    if (!missing.empty()) GTEST_SKIP() << missing;
    server_.emplace("s");
    // Every host gets the same bridge address, as container hosts do.
    const auto add_bridge = [](const Host& host) {
      host.run("link add docker0 type bridge");
      host.use("docker0", "172.17.0.1/16");
    };
    add_bridge(*server_);
    for (std::size_t i = 0; i < kLinks.size(); ++i) {
      const auto& [server, caller, prefix_size] = kLinks[i];
      const std::string size = "/" + std::to_string(prefix_size);
      callers_.push_back(std::make_unique<Host>("c" + std::to_string(i)));
      server_->join("eth" + std::to_string(i), server + size, *callers_.back(), "eth0",
                    caller + size);
      add_bridge(*callers_.back());
    }
    registry_ = server_->start("rtpm-registryd", {"--host", "any", "--insecure"});
    ASSERT_TRUE(registry_);
  }
  [[nodiscard]] bool start_arm(const std::vector<std::string>& more) {
    std::vector<std::string> arguments{"--insecure", "--registry", registry_at("127.0.0.1")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    device_ = server_->start("rtpm-deviced", arguments);
    return device_.has_value();
  }
  /// Runs `rtpm` with the registry's address as the caller reaches it.
  [[nodiscard]] test::Process::End run_at(std::size_t caller,
                                          std::vector<std::string> arguments) const {
    arguments.insert(arguments.begin(), {"--registry", registry_at(in_url(kLinks[caller].server))});
    return callers_[caller]->run_tool(std::move(arguments));
  }

  std::optional<Host> server_;
  std::vector<std::unique_ptr<Host>> callers_;
  std::optional<Daemon> registry_, device_;
};

TEST_F(ServerOfThreeNetworks, IsReachedInEachNetworkByItsRegisteredAddress) {
  ASSERT_TRUE(start_arm({"--host", "any"}));
  for (const auto& [server, caller, prefix_size] : kLinks) {
    const std::string line = "rtpm-deviced: serves " + in_url(server) + ":";
    EXPECT_TRUE(device_->process.wait_for_errors(line, kPatience)) << device_->process.errors();
  }
  for (std::size_t i = 0; i < kLinks.size(); ++i) {
    const auto resolved = run_at(i, {"resolve", "lab/arm0"});
    EXPECT_TRUE(resolved.output.starts_with("rtpm://" + in_url(kLinks[i].server)))
        << resolved.output << resolved.errors;
    EXPECT_EQ(resolved.output.find("172.17.0.1"), std::string::npos) << resolved.output;
    const auto read = run_at(i, {"call", "lab/arm0", "read", "{}"});
    EXPECT_EQ(read.exit_code, 0) << read.errors;
    const auto listed = run_at(i, {"list", "--json"});
    const auto entry = nlohmann::json::parse(listed.output).at(0);
    EXPECT_EQ(entry.at("hosts").size(), 4u) << entry;
    EXPECT_TRUE(entry.at("is_of_other_host"));
  }
  const auto here =
      server_->run_tool({"--registry", registry_at("127.0.0.1"), "call", "lab/arm0", "read", "{}"});
  EXPECT_EQ(here.exit_code, 0) << here.errors;
}

TEST_F(ServerOfThreeNetworks, IsReachedWhereItServes) {
  ASSERT_TRUE(start_arm({"--host", "eth1,localhost"}));
  EXPECT_EQ(run_at(1, {"call", "lab/arm0", "read", "{}"}).exit_code, 0);
  const auto outside = run_at(0, {"--deadline", "200ms", "call", "lab/arm0", "read", "{}"});
  EXPECT_NE(outside.exit_code, 0);
  EXPECT_NE(outside.errors.find("10.78.2.1"), std::string::npos) << outside.errors;
}

TEST_F(ServerOfThreeNetworks, ReportsThatItServesItsOwnHostOnly) {
  ASSERT_TRUE(start_arm({}));
  for (std::size_t i = 0; i < kLinks.size(); ++i) {
    const auto refused = run_at(i, {"call", "lab/arm0", "read", "{}"});
    EXPECT_NE(refused.exit_code, 0);
    expect_text(refused.errors, {"serves its own host only", "start its server with --host any"});
  }
  // A call from this host to one of its own addresses works, too.
  for (const auto& [server, caller, prefix_size] : kLinks) {
    const auto here = server_->run_tool(
        {"--registry", registry_at(in_url(server)), "call", "lab/arm0", "read", "{}"});
    EXPECT_EQ(here.exit_code, 0) << here.errors;
  }
}

TEST_F(ServerOfThreeNetworks, IsFoundAtItsAdvertisedAddress) {
  ASSERT_TRUE(start_arm({"--host", "any", "--advertise", "10.78.2.1,robot.invalid"}));
  const auto resolved = run_at(1, {"resolve", "lab/arm0"});
  EXPECT_TRUE(resolved.output.starts_with("rtpm://10.78.2.1,robot.invalid:")) << resolved.output;
  EXPECT_EQ(run_at(1, {"call", "lab/arm0", "read", "{}"}).exit_code, 0);
}

}  // namespace
}  // namespace rtpm::system_test
