#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "rtpm/test/process.hpp"

namespace rtpm::system_test {

/// Three nodes of etcd, each on its own host: a network namespace behind a bridge. The bridge is in
/// this thread's namespace, which is also new, as long as this object lives.
/// @threads  one; threads that it starts are in the same network
class EtcdCluster {
 public:
  static constexpr int kNodeCount = 3;

  /// Why no cluster can run here; nullopt if one can.
  [[nodiscard]] static std::optional<std::string> missing();

  EtcdCluster();
  EtcdCluster(const EtcdCluster&) = delete;
  EtcdCluster& operator=(const EtcdCluster&) = delete;
  ~EtcdCluster();

  /// "etcd://10.99.0.1:2379,…", for `--store`.
  [[nodiscard]] std::string url() const;
  /// Waits until there is a leader that all nodes follow; returns -1 if that takes too long.
  [[nodiscard]] int await_leader();
  /// The leader that most nodes know now; -1 if there is none.
  [[nodiscard]] int leader() const;

  void kill(int node);
  void start(int node);
  void freeze(int node);
  void thaw(int node);
  /// Drops all packets to and from the node.
  void cut_off(int node);
  /// Drops all packets between it and the other nodes; registries still reach it.
  void part_from_nodes(int node);
  void heal(int node);

  /// Drops all former changes of names, like a site's own compaction.
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
