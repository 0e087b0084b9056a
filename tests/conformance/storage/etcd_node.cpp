#include "etcd_node.hpp"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <memory>

#include "http.hpp"
#include "rtpm/test/etcd.hpp"
#include "rtpm/test/os.hpp"

namespace rtpm::storage_test {
namespace {

/// A port that was free a moment ago.
std::string free_port() {
  const int handle = ::socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof address;
  ::bind(handle, reinterpret_cast<const sockaddr*>(&address), size);
  ::getsockname(handle, reinterpret_cast<sockaddr*>(&address), &size);
  ::close(handle);
  return std::to_string(ntohs(address.sin_port));
}

bool answers(const std::string& endpoint) {
  static const std::atomic<bool> kNeverStopping = false;
  etcd_store::HttpClient client(kNeverStopping);
  const auto reply = client.post("http://" + endpoint + "/v3/kv/range", R"({"key":"eA=="})",
                                 std::chrono::seconds{1});
  return reply && reply->status == 200;
}

}  // namespace

EtcdNode* EtcdNode::shared() {
  if (std::system("command -v etcd >/dev/null") != 0) return nullptr;
  static const std::unique_ptr<EtcdNode> kNode(new EtcdNode);
  return answers(kNode->endpoint_) ? kNode.get() : nullptr;
}

std::unique_ptr<EtcdNode> EtcdNode::own() {
  if (shared() == nullptr) return nullptr;
  std::unique_ptr<EtcdNode> node(new EtcdNode);
  return answers(node->endpoint_) ? std::move(node) : nullptr;
}

EtcdNode::EtcdNode()
    : endpoint_("127.0.0.1:" + free_port()), peer_endpoint_("127.0.0.1:" + free_port()) {
  folder_ = (std::filesystem::temp_directory_path() / "rtpm-etcd-XXXXXX").string();
  if (::mkdtemp(folder_.data()) != nullptr) start();
}

void EtcdNode::start() {
  const std::string peer = "http://" + peer_endpoint_;
  std::vector<std::string> command = test::etcd_command({.name = "n0",
                                                         .data_folder = folder_ + "/n0",
                                                         .client_url = "http://" + endpoint_,
                                                         .peer_url = peer,
                                                         .cluster = "n0=" + peer,
                                                         .log_file = folder_ + "/log"});
  command.insert(command.begin(), "/usr/bin/env");
  command.insert(command.end(), {"--initial-cluster-token", token_});
  process_.emplace(command);
  static_cast<void>(test::await([&] { return answers(endpoint_); }));
}

void EtcdNode::stop() {
  process_->send_signal(SIGTERM);
  static_cast<void>(process_->wait(std::chrono::seconds{20}));
  process_.reset();
}

void EtcdNode::back_up() {
  stop();
  std::filesystem::copy(folder_ + "/n0", folder_ + "/backup",
                        std::filesystem::copy_options::recursive);
  start();
}

void EtcdNode::restore_backup() {
  stop();
  std::filesystem::remove_all(folder_ + "/n0");
  std::filesystem::copy(folder_ + "/backup", folder_ + "/n0",
                        std::filesystem::copy_options::recursive);
  start();
}

void EtcdNode::restore_nothing(const std::string& token) {
  stop();
  std::filesystem::remove_all(folder_ + "/n0");
  token_ = token;
  start();
}

EtcdNode::~EtcdNode() {
  process_.reset();
  std::error_code ignored;
  std::filesystem::remove_all(folder_, ignored);
}

std::string EtcdNode::fresh_url() {
  return "etcd://" + endpoint_ + "/test" + std::to_string(prefix_count_++);
}

}  // namespace rtpm::storage_test
