#pragma once

#include <string>
#include <vector>

namespace rtpm::test {

/// One node of a cluster of etcd.
struct EtcdNodeOptions {
  std::string name{};
  std::string data_folder{};
  std::string client_url{};
  std::string peer_url{};
  std::string cluster{};  ///< All nodes: "n0=http://…,n1=http://…".
  std::string log_file{};
};

/// The command that starts the node, which logs fatal errors only.
[[nodiscard]] inline std::vector<std::string> etcd_command(const EtcdNodeOptions& node) {
  return {"etcd",
          "--name",
          node.name,
          "--data-dir",
          node.data_folder,
          "--listen-client-urls",
          node.client_url,
          "--advertise-client-urls",
          node.client_url,
          "--listen-peer-urls",
          node.peer_url,
          "--initial-advertise-peer-urls",
          node.peer_url,
          "--initial-cluster",
          node.cluster,
          "--logger",
          "zap",
          "--log-level",
          "fatal",
          "--log-outputs",
          node.log_file};
}

}  // namespace rtpm::test
