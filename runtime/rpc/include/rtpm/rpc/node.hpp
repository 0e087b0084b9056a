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

/// Turns a name such as "lab/arm0" into the URL of the server that has it. rtpm::names has the
/// implementation that asks the registry.
/// @threads  any, several at once: those that bind, and the node's own, which follows names
class Resolver {
 public:
  Resolver() = default;
  Resolver(const Resolver&) = delete;
  Resolver& operator=(const Resolver&) = delete;
  virtual ~Resolver() = default;
  /// The URL "rtpm://host:port/path" for `name`; answers by `deadline`.
  /// @realtime set-up only
  /// @errors   the registry does not answer, the name is not bound: in words, with the remedy
  [[nodiscard]] virtual expected<std::string, SetupError> resolve(std::string_view name,
                                                                  MonotonicTime deadline) = 0;
};

/// The transport over which a binding sends its calls.
enum class Transport : std::uint8_t {
  /// The best that reaches the server: none in the same program, shared memory on one host, else
  /// UDP.
  kAuto,
  kUdp,
  kTcp,
  kSharedMemory,
  /// The server is in the same program: its lane runs the call, on memory that both sides see.
  /// Reported by Binding::transport(); to ask for it, ask for kAuto.
  kLocal,
};

/// "auto", "udp", "tcp", "shm" or "local".
[[nodiscard]] std::string_view to_string(Transport transport) noexcept;

/// How a program calls others.
struct NodeConfig {
  rt::WaitConfig wait{};                                ///< How a caller waits for its reply.
  Duration default_deadline = std::chrono::seconds{1};  ///< Applies if method and call state none.
  Transport transport = Transport::kAuto;               ///< Applies if a binding states none.
  PriorityTransform outbound_priority = nullptr;  ///< Null if calls go out at their own priority.
  /// Runs calls to servers of the same program without a transport, unless one is asked for.
  bool collocates = true;
  std::uint32_t channel_count_max = 64;  ///< Call channels per server and band: calls at a time.
  std::uint32_t message_size_max = 16 * 1024 * 1024;  ///< Bytes of a request, reply or item.
  /// Where servers have their sockets for shared memory, if not under abstract names: as
  /// ServerConfig::shared_memory_folder.
  std::string shared_memory_folder{};
  NodeSecurity security{};
  /// The security of servers made for this node, such as the one of the program's own names.
  ServerSecurity served{};
};

/// The calling side of a program: its identity towards servers and the channels to them. Bindings
/// share it, so it must outlive them.
/// @threads  bind and call from any thread; use() before the first bind
class Node {
 public:
  explicit Node(NodeConfig config = {});
  Node(const Node&) = delete;
  Node& operator=(const Node&) = delete;
  ~Node();

  /// Lets bindings by name ask `resolver`: when they are made, and whenever their server is gone.
  /// It must outlive the node, unless forget() is called before its end.
  /// @realtime set-up only
  void use(Resolver& resolver) noexcept;
  /// Stops asking `resolver`. Returns once a question that is under way has ended, after 1 s at
  /// most. Bindings by name stay with the servers that they have.
  /// @realtime set-up only
  void forget(Resolver& resolver) noexcept;

  /// The name leads elsewhere now, or to another start of its server: its bindings, and those of
  /// names below it, look it up at once, at most every 50 ms. Does nothing without bindings.
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
