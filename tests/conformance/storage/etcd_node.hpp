#pragma once

#include <memory>
#include <optional>
#include <string>

#include "rtpm/test/process.hpp"

namespace rtpm::storage_test {

/// A cluster of one node.
class EtcdNode {
 public:
  /// That of the tests of this program; each takes a prefix of its own. Null: etcd is not installed
  /// here, or does not start.
  [[nodiscard]] static EtcdNode* shared();
  /// One that a test has for itself; null likewise.
  [[nodiscard]] static std::unique_ptr<EtcdNode> own();

  /// Copies what it has stored, while it is stopped for a moment.
  void back_up();
  /// Stops it, gives it what back_up() has copied, or nothing, and starts it again.
  void restore_backup();
  /// @param token  another one makes it another cluster
  void restore_nothing(const std::string& token);

  /// For make_etcd_storage(), with a prefix that nobody had before.
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
