#pragma once

#include <optional>
#include <string>

#include "rtpm/test/process.hpp"

namespace rtpm::storage_test {

/// A cluster of one node, shared by the tests of this program; each takes a prefix of its own.
class EtcdNode {
 public:
  /// Null: etcd is not installed here, or does not start.
  [[nodiscard]] static EtcdNode* shared();

  /// For make_etcd_storage(), with a prefix that nobody had before.
  [[nodiscard]] std::string fresh_url();

  ~EtcdNode();

 private:
  EtcdNode();
  std::string folder_{};
  std::string endpoint_{};
  int prefix_count_ = 0;
  std::optional<test::Process> process_{};
};

inline constexpr const char* kNoEtcd = "the program 'etcd' is missing (Debian package etcd-server)";

}  // namespace rtpm::storage_test
