#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "rtpm/test/process.hpp"

namespace rtpm::system_test {

/// Three nodes of etcd, each a host of its own: a network namespace behind a bridge in this
/// thread's, which is a new one, too, until this ends.
/// @threads  one; threads that it starts are in the same network
class EtcdCluster {
 public:
  static constexpr int kNodeCount = 3;

  /// Why there can be none here; nothing if there can.
  [[nodiscard]] static std::optional<std::string> missing();

  EtcdCluster();
  EtcdCluster(const EtcdCluster&) = delete;
  EtcdCluster& operator=(const EtcdCluster&) = delete;
  ~EtcdCluster();

  /// "etcd://10.99.0.1:2379,…", for `--store`.
  [[nodiscard]] std::string url() const;
  /// Waits until there is a leader, and all nodes follow it; -1: that does not come.
  [[nodiscard]] int await_leader();
  /// The leader as most nodes know it now; -1: none.
  [[nodiscard]] int leader() const;

  void kill(int node);
  void start(int node);
  void freeze(int node);
  void thaw(int node);
  /// No packet gets to the node or from it.
  void cut_off(int node);
  /// No packet gets from it to other nodes or back; registries still reach it.
  void part_from_nodes(int node);
  void heal(int node);

  /// Forgets all former changes of names, as a site's own compaction does.
  void compact();

 private:
  [[nodiscard]] std::string space(int node) const;
  [[nodiscard]] static std::string address(int node);

  std::string folder_{};
  std::string name_{};
  int own_network_ = -1;
  std::array<std::optional<test::Process>, kNodeCount> nodes_{};
};

}  // namespace rtpm::system_test
