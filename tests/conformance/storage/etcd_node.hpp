#pragma once

#include <memory>
#include <optional>
#include <string>

#include "rtpm/test/process.hpp"

namespace rtpm::storage_test {

/// A cluster of one node.
class EtcdNode {
 public:
  /// The node that all tests of this program share; each takes a prefix of its own. Null if etcd
  /// is not installed here, or does not start.
  [[nodiscard]] static EtcdNode* shared();
  /// A node for one test alone; null if etcd is missing or does not start.
  [[nodiscard]] static std::unique_ptr<EtcdNode> own();

  /// Copies its stored data, while it is stopped for a moment.
  void back_up();
  /// Stops it, restores the copy of back_up(), or nothing, and starts it again.
  void restore_backup();
  /// @param token  names the cluster; another token makes another cluster
  void restore_nothing(const std::string& token);

  /// A URL for make_etcd_storage(), with an unused prefix.
  [[nodiscard]] std::string fresh_url();

  ~EtcdNode();

 private:
  EtcdNode();
  void start();
  void stop();
  std::string folder_{};
  std::string endpoint_{};
  std::string peer_endpoint_{};
  std::string token_ = "one";
  int prefix_count_ = 0;
  std::optional<test::Process> process_{};
};

inline constexpr const char* kNoEtcd = "the program 'etcd' is missing (Debian package etcd-server)";

}  // namespace rtpm::storage_test
