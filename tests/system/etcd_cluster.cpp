#include "etcd_cluster.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <signal.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <cstdlib>
#include <map>
#include <nlohmann/json.hpp>

#include "http.hpp"
#include "programs.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/test/etcd.hpp"
#include "rtpm/test/os.hpp"

namespace rtpm::system_test {
namespace {

using namespace std::chrono_literals;

/// Runs a command of ip or nft; the test fails if that fails.
void run_command(const std::string& command) {
  EXPECT_EQ(std::system((command + " >/dev/null 2>&1").c_str()), 0) << command;
}

/// Returns a node's answer; null if none comes in time.
nlohmann::json ask(const std::string& address, const std::string& path, const std::string& body) {
  static const std::atomic<bool> kNeverStopping = false;
  etcd_store::HttpClient client(kNeverStopping);
  const auto reply = client.post("http://" + address + ":2379" + path, body, 500ms);
  return reply ? nlohmann::json::parse(reply->body, nullptr, false) : nlohmann::json();
}

}  // namespace

std::optional<std::string> EtcdCluster::missing() {
  for (const char* program : {"ip", "nft", "etcd"}) {
    if (std::system((std::string("command -v ") + program + " >/dev/null").c_str()) != 0) {
      return std::string("the program '") + program + "' is missing";
    }
  }
  const auto end = test::run({"/usr/bin/unshare", "--net", "true"}, kPatience);
  if (!end || end->exit_code != 0) return "network namespaces take the right CAP_SYS_ADMIN";
  return std::nullopt;
}

EtcdCluster::EtcdCluster() : name_("rtpm-" + std::to_string(::getpid()) + "-") {
  folder_ = (std::filesystem::temp_directory_path() / "rtpm-etcd-XXXXXX").string();
  EXPECT_NE(::mkdtemp(folder_.data()), nullptr);
  own_network_ = ::open("/proc/thread-self/ns/net", O_RDONLY | O_CLOEXEC);
  EXPECT_EQ(::unshare(CLONE_NEWNET), 0);
  run_command(
      "ip link set lo up && ip link add name nodes type bridge && "
      "ip addr add 10.99.0.254/24 dev nodes && ip link set nodes up");
  for (int node = 0; node < kNodeCount; ++node) {
    const std::string port = "port" + std::to_string(node);
    run_command("ip netns add " + space(node));
    run_command("ip link add " + port + " type veth peer name eth0 netns " + space(node));
    run_command("ip link set " + port + " master nodes up");
    run_command("ip -n " + space(node) + " addr add " + address(node) + "/24 dev eth0");
    run_command("ip -n " + space(node) + " link set eth0 up");
    run_command("ip -n " + space(node) + " link set lo up");
    start(node);
  }
}

EtcdCluster::~EtcdCluster() {
  for (int node = 0; node < kNodeCount; ++node) {
    nodes_[static_cast<std::size_t>(node)].reset();
    run_command("ip netns del " + space(node));
  }
  EXPECT_EQ(::setns(own_network_, CLONE_NEWNET), 0);
  ::close(own_network_);
  std::error_code ignored;
  std::filesystem::remove_all(folder_, ignored);
}

std::string EtcdCluster::space(int node) const {
  return name_ + std::to_string(node);
}
std::string EtcdCluster::address(int node) {
  return "10.99.0." + std::to_string(node + 1);
}

std::string EtcdCluster::url() const {
  std::string url;
  for (int node = 0; node < kNodeCount; ++node)
    url += (node == 0 ? "etcd://" : ",") + address(node) + ":2379";
  return url;
}

void EtcdCluster::start(int node) {
  std::string all;
  for (int each = 0; each < kNodeCount; ++each)
    all += (each == 0 ? "n" : ",n") + std::to_string(each) + "=http://" + address(each) + ":2380";
  const std::string client = "http://" + address(node) + ":2379";
  const std::string peer = "http://" + address(node) + ":2380";
  std::vector<std::string> command =
      test::etcd_command({.name = "n" + std::to_string(node),
                          .data_folder = folder_ + "/n" + std::to_string(node),
                          .client_url = client,
                          .peer_url = peer,
                          .cluster = all,
                          .log_file = folder_ + "/log" + std::to_string(node)});
  command.insert(command.begin(), {"/usr/bin/env", "ip", "netns", "exec", space(node)});
  nodes_[static_cast<std::size_t>(node)].emplace(command);
}

int EtcdCluster::leader() const {
  std::map<std::string, int> node_of;
  std::map<std::string, int> votes;
  for (int node = 0; node < kNodeCount; ++node) {
    const auto status = ask(address(node), "/v3/maintenance/status", "{}");
    if (!status.is_object() || !status.contains("header")) continue;
    node_of[status["header"].value("member_id", "")] = node;
    ++votes[status.value("leader", "")];
  }
  for (const auto& [id, count] : votes) {
    if (count > kNodeCount / 2 && node_of.contains(id)) return node_of[id];
  }
  return -1;
}

int EtcdCluster::await_leader() {
  int found = -1;
  static_cast<void>(test::await([&] { return (found = leader()) >= 0; }));
  return found;
}

void EtcdCluster::kill(int node) {
  auto& process = nodes_[static_cast<std::size_t>(node)];
  process->send_signal(SIGKILL);
  EXPECT_TRUE(process->wait(kPatience));
}
void EtcdCluster::freeze(int node) {
  nodes_[static_cast<std::size_t>(node)]->stop();
}
void EtcdCluster::thaw(int node) {
  nodes_[static_cast<std::size_t>(node)]->send_signal(SIGCONT);
}
void EtcdCluster::cut_off(int node) {
  run_command("ip link set port" + std::to_string(node) + " down");
}
void EtcdCluster::part_from_nodes(int node) {
  std::string others;
  for (int each = 0; each < kNodeCount; ++each) {
    if (each != node) others += (others.empty() ? "" : ",") + address(each);
  }
  const std::string nft = "ip netns exec " + space(node) + " nft ";
  run_command(nft + "add table ip parted");
  run_command(nft + "'add chain ip parted in { type filter hook input priority 0; }'");
  run_command(nft + "'add chain ip parted out { type filter hook output priority 0; }'");
  run_command(nft + "'add rule ip parted in ip saddr { " + others + " } drop'");
  run_command(nft + "'add rule ip parted out ip daddr { " + others + " } drop'");
}
void EtcdCluster::heal(int node) {
  run_command("ip link set port" + std::to_string(node) + " up");
  static_cast<void>(std::system(
      ("ip netns exec " + space(node) + " nft delete table ip parted 2>/dev/null").c_str()));
}

void EtcdCluster::compact() {
  const auto status = ask(address(0), "/v3/maintenance/status", "{}");
  ASSERT_TRUE(status.is_object());
  const auto revision = status["header"].value("revision", "");
  static_cast<void>(ask(address(0), "/v3/kv/compaction", R"({"revision":")" + revision + R"("})"));
}

}  // namespace rtpm::system_test
