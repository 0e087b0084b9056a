#pragma once

#include <map>
#include <string>
#include <vector>

#include "live/callbacks.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/names/directory.hpp"
#include "rtpm/names/lapsed.hpp"
#include "rtpm/rpc/node.hpp"

namespace rtpm::console {

/// An object that the registry names, or an object below it.
struct ObjectView {
  std::string name{};
  std::string interface {};
  std::string url{};
  std::string service_url{};  ///< The name service at which it is bound.
  friend bool operator==(const ObjectView&, const ObjectView&) = default;
};

struct ObjectsView {
  Standing registry{};
  /// Sorted by name; while the registry is gone, the state of its last reply.
  std::vector<ObjectView> objects{};
  std::vector<names::LapsedName> lapsed{};  ///< Names whose servers are lost.
  /// Registries that report lapsed names: a name that vanishes there without lapsing was unbound.
  std::vector<std::string> lapsed_services{};
};

/// Polls the registry, and the catalogs of the servers that it names.
/// @ownership refers to its node
/// @threads  one
class ObjectWatch {
 public:
  ObjectWatch(rpc::Node& node, const std::string& registry);
  [[nodiscard]] const ObjectsView& look();

 private:
  struct Server {
    std::map<std::string, std::string> interfaces{};  ///< Keyed by path.
    std::string fingerprint{};  ///< Hash of the names that lead to this server.
    MonotonicTime next{};       ///< When the next request is made.
  };
  void ask(Server& server, const std::string& url);
  void look_for_lapsed(bool has_changed);

  rpc::Node& node_;
  const std::string registry_;
  names::Directory directory_;
  std::vector<std::string> names_{};  ///< The names at the last look.
  MonotonicTime next_lapsed_{};
  std::map<std::string, Server> servers_{};  ///< Keyed by "host:port".
  ObjectsView view_{};
};

}  // namespace rtpm::console
