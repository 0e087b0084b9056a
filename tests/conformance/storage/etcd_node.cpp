#include "etcd_node.hpp"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
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

EtcdNode::EtcdNode() : endpoint_("127.0.0.1:" + free_port()) {
  folder_ = (std::filesystem::temp_directory_path() / "rtpm-etcd-XXXXXX").string();
  if (::mkdtemp(folder_.data()) == nullptr) return;
  const std::string client = "http://" + endpoint_;
  const std::string peer = "http://127.0.0.1:" + free_port();
  std::vector<std::string> command = test::etcd_command({.name = "n0",
                                                         .data_folder = folder_ + "/n0",
                                                         .client_url = client,
                                                         .peer_url = peer,
                                                         .cluster = "n0=" + peer,
                                                         .log_file = folder_ + "/log"});
  command.insert(command.begin(), "/usr/bin/env");
  process_.emplace(command);
  static_cast<void>(test::await([&] { return answers(endpoint_); }));
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
