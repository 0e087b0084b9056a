#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "rtpm/base/priority.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/rpc/error.hpp"
#include "rtpm/rpc/interface.hpp"
#include "rtpm/rpc/security.hpp"
#include "rtpm/rt/wait.hpp"

namespace rtpm::rpc {

/// Resolves a name such as "lab/arm0" to its server's URL. rtpm::names implements it with the
/// registry.
/// @threads  any, concurrently: threads that bind, and the node's rebinding thread
class Resolver {
 public:
  Resolver() = default;
  Resolver(const Resolver&) = delete;
  Resolver& operator=(const Resolver&) = delete;
  virtual ~Resolver() = default;
  /// Returns the URL "rtpm://host:port/path" for `name`, at the latest at `deadline`.
  /// @realtime set-up only
  /// @errors   the registry does not answer, or the name is not bound; the text includes a remedy
  [[nodiscard]] virtual expected<std::string, SetupError> resolve(std::string_view name,
                                                                  MonotonicTime deadline) = 0;
};

/// The transport over which a binding sends its calls.
enum class Transport : std::uint8_t {
  /// The best one that reaches the server: kLocal within a program, shared memory on one host,
  /// otherwise UDP.
  kAuto,
  kUdp,
  kTcp,
  kSharedMemory,
  /// The server is in the same program: its lane runs the call directly on shared buffers.
  /// Binding::transport() reports it; to request it, use kAuto.
  kLocal,
};

/// "auto", "udp", "tcp", "shm" or "local".
[[nodiscard]] std::string_view to_string(Transport transport) noexcept;

/// How a program makes calls.
struct NodeConfig {
  rt::WaitConfig wait{};  ///< How a caller waits for its reply.
  /// Applies if neither method nor call sets one.
  Duration default_deadline = std::chrono::seconds{1};
  Transport transport = Transport::kAuto;         ///< Applies if a binding sets none.
  PriorityTransform outbound_priority = nullptr;  ///< Null if calls keep their own priority.
  /// Calls servers in the same program without a transport, unless a binding requests one.
  bool collocates = true;
  /// Call channels per server and band, so concurrent calls.
  std::uint32_t channel_count_max = 64;
  /// The largest request, reply or item in bytes.
  std::uint32_t message_size_max = 16 * 1024 * 1024;
  /// The folder of the servers' shared-memory sockets, as ServerConfig::shared_memory_folder; if
  /// empty, abstract names.
  std::string shared_memory_folder{};
  NodeSecurity security{};
  /// The security of servers created for this node, such as the program's own name service.
  ServerSecurity served{};
};

/// The calling side of a program: its identity towards servers and its channels to them. Bindings
/// share it, so it must outlive them.
/// @threads  bind and call from any thread; use() before the first bind
class Node {
 public:
  explicit Node(NodeConfig config = {});
  Node(const Node&) = delete;
  Node& operator=(const Node&) = delete;
  ~Node();

  /// Sets the resolver for bindings by name, which call it when they are created and whenever their
  /// server is gone. `resolver` must outlive the node, or forget() must be called before its
  /// destruction.
  /// @realtime set-up only
  void use(Resolver& resolver) noexcept;
  /// Stops using `resolver`. Waits for a look-up in progress, at most 1 s. Bindings by name stay
  /// with their current servers.
  /// @realtime set-up only
  void forget(Resolver& resolver) noexcept;

  /// Reports that the name leads elsewhere now, or that its server restarted. Bindings to it, and
  /// to names below it, resolve it at once, at most every 50 ms. Does nothing without such
  /// bindings.
  /// @threads  any
  /// @realtime set-up only
  void look_again(std::string_view name) noexcept;

  [[nodiscard]] const NodeConfig& config() const noexcept;

  class Impl;
  [[nodiscard]] Impl& impl() noexcept { return *impl_; }

 private:
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtpm::rpc
