#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/priority.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/rpc/async.hpp"
#include "rtpm/rpc/error.hpp"
#include "rtpm/rpc/interface.hpp"
#include "rtpm/rpc/node.hpp"

namespace rtpm::wire {
enum class Delivery : std::uint8_t;
struct PeerClock;
}  // namespace rtpm::wire

namespace rtpm::rpc {

/// The options of one call; every field has a default.
struct CallOptions {
  /// The call's priority. By default the calling thread's current_priority(), or the object's.
  std::optional<Priority> priority{};
  /// How long the caller waits, relative to the call. By default the method's deadline, or the
  /// node's; a nested call without a deadline of its own waits no longer than the caller of the
  /// enclosing method. An explicit deadline is not shortened.
  std::optional<Duration> deadline{};
  /// Passed on to the servant to trace one action across programs. In a nested call, 0 means the
  /// enclosing call's trace id.
  std::uint64_t trace_id = 0;
};

inline constexpr std::uint32_t kMissCountMin = 2;
inline constexpr std::uint32_t kMissCountMax = 6;

/// How a stream is read.
struct StreamOptions {
  /// The options of the call. The deadline covers the whole stream; by default there is none.
  CallOptions call{};
  /// How many items may be in flight, 1…32: how far the server may be ahead of the reader.
  std::uint32_t window = 16;
  /// A reader that waits in next() probes the server at least every half second. The stream ends
  /// when this many probes in a row go unanswered, kMissCountMin…kMissCountMax.
  /// @source   spec/hprotocol.md#hp-5.10-7
  std::uint32_t miss_count_max = kMissCountMax;
  /// How long the reader may go without calling next(). Until then the server keeps the items that
  /// it has not sent; after that it ends the stream, and next() reports kStreamLost. Default: over
  /// TCP and shared memory, as long as the connection lasts; over UDP 10 s, at most 30 s.
  std::optional<Duration> pause_max{};
};

/// How a binding is made.
struct BindOptions {
  Transport transport = Transport::kAuto;
  /// How long bind() may take, including the registry's answer.
  Duration deadline = std::chrono::seconds{1};
  /// The priorities that calls will have. bind() opens a channel for each of their bands, so that
  /// the first call is as fast as the thousandth. Empty for all, up to the server's ceiling.
  std::vector<Priority> warm_up{};
  /// The binding shares its channels with no other binding of the node.
  /// @source   RT-CORBA's private connections
  bool is_private = false;
};

/// A reply's bytes and the call channel that holds them. Destruction returns the channel, so do not
/// keep it.
/// @threads  one at a time
/// @realtime alloc-free
class ReplyLease {
 public:
  ReplyLease() noexcept = default;
  ReplyLease(ReplyLease&& other) noexcept { *this = std::move(other); }
  ReplyLease& operator=(ReplyLease&& other) noexcept {
    std::swap(bytes_, other.bytes_);
    std::swap(channel_, other.channel_);
    std::swap(local_, other.local_);
    return *this;
  }
  ~ReplyLease();

  /// The reply's payload, aligned to 16 bytes; valid as long as this lease lives.
  [[nodiscard]] ConstBytes bytes() const noexcept { return bytes_; }

 private:
  friend class Binding;
  friend class PendingReply;
  friend class expected<ReplyLease, CallError>;
  ReplyLease(ConstBytes bytes, class CallChannel* channel) noexcept
      : bytes_(bytes), channel_(channel) {}
  ReplyLease(ConstBytes bytes, class LocalChannel& channel) noexcept
      : bytes_(bytes), local_(&channel) {}

  ConstBytes bytes_{};
  class CallChannel* channel_ = nullptr;
  class LocalChannel* local_ = nullptr;
};

/// How a binding by name has followed the name.
struct FollowStatus {
  std::uint64_t resolve_count = 0;  ///< Look-ups of the name since the bind.
  std::uint64_t move_count = 0;     ///< How often the name led to another URL.
  /// Why calls fail now: the name is not bound, its server does not answer, or the server has
  /// another interface. Empty while no problem is known.
  std::string trouble{};
};

/// A bound object of a server. Every generated stub holds one.
///
/// A binding by name follows the name. When a call finds the server gone (unreachable, silent,
/// stopped, restarted, or another program at its address), the node resolves the name and binds
/// again on its time-shared thread "rtpm-rebind"; later calls go to the new server. Until then,
/// calls fail at once or at their deadline with the old server's errors. A failed call is repeated
/// at the new server only if it is idempotent or was not sent. A server with another interface is
/// not accepted: calls return kWrongInterface or kNoSuchMethod, and follow_status() gives the
/// reason. All bindings of a node to one name share a look-up, at most one per second and at least
/// one every four seconds, until the name leads to a server that answers. With or without a name,
/// the next call finds a server that restarted at its old address.
///
/// @ownership refers to its node, which must outlive it; by name, to the node's resolver, too.
///            Destruction waits for a rebind in progress, at most 1 s
/// @threads  any, concurrently: each call takes its own call channel
/// @realtime see each call. Look-ups and rebinds run on "rtpm-rebind" only, never in a caller's
///           thread; the first call of an outage makes one extra syscall
class Binding {
 public:
  /// Binds `target`, a URL "rtpm://host:port/path" or a name for the node's resolver. Checks that
  /// the object has `interface`, and opens the channels of `options.warm_up`.
  /// @realtime set-up only
  /// @errors   no resolver, an unknown name, no server there, a refusal, or an interface that
  ///           differs (the text names the method)
  [[nodiscard]] static expected<Binding, SetupError> bind(Node& node, std::string_view target,
                                                          const InterfaceDescriptor& interface,
                                                          const BindOptions& options = {});
  Binding(Binding&&) noexcept;
  Binding& operator=(Binding&&) noexcept;
  ~Binding();

  /// Calls `method` with the encoded `request` and waits for the reply on this thread; no other
  /// thread takes part. The server runs the call at most once, even if the network loses or
  /// duplicates frames.
  /// @realtime alloc-free once the band of the priority is open; one send and one receive per try,
  ///           plus what the wait strategy needs to block
  /// @errors   see CallError
  [[nodiscard]] expected<ReplyLease, CallError> call(const MethodDescriptor& method,
                                                     ConstBytes request,
                                                     const CallOptions& options = {}) noexcept;

  /// Calls `method`, which returns nothing, and waits as `delivery` says: not at all (kSent), until
  /// the server is about to run it, or until it has run. A request that does not fit a frame is
  /// always confirmed. With kSent, ok does not mean that the method ran:
  ///
  /// - kSharedMemory: ok means that the request is in the server's ring. A loss is reported by the
  ///   first send() later than 1 ms after the server ended.
  /// - kTcp: ok means that the kernel has it, and sends in order. A loss is reported once the
  ///   kernel knows that the connection ended: 3 s after a host vanished.
  /// - kUdp: ok means that it left this host, unless the kernel dropped it. A loss of the session
  ///   is reported when the server's host answers that the port is closed, or the restarted server
  ///   that the session is unknown. A loss of single datagrams is never reported.
  /// - kLocal: ok means that it waits in the server's lane. Oneways still waiting when the server
  ///   stops are lost.
  ///
  /// A loss is reported as kMaybeLost, by the next send() of this binding or by check_oneways().
  ///
  /// @realtime like call(); kSent makes an extra system call each millisecond; over shared memory,
  ///           each 50 µs while the server has not read what was sent
  /// @errors   those of call(). After an error, a kSent oneway of one frame was not sent.
  ///           kMaybeLost: earlier ones may not have arrived either, see lost_oneway_count() ·
  ///           kOverload: the host's buffer is full, or over kLocal
  ///           ServerConfig::local_oneway_count_max oneways already wait or run: send less often
  /// @source   spec/hprotocol.md#hp-5.8; CORBA's SyncScope
  [[nodiscard]] expected<void, CallError> send(const MethodDescriptor& method, ConstBytes request,
                                               wire::Delivery delivery,
                                               const CallOptions& options = {}) noexcept;

  /// Checks, without sending, whether kSent oneways may have been lost, for a caller that sends no
  /// more of them. Skips channels that other threads are using.
  /// @realtime alloc-free, at most two syscalls per channel with unconfirmed oneways
  /// @errors   kMaybeLost, once
  [[nodiscard]] expected<void, CallError> check_oneways() noexcept;
  /// The number of oneways that were reported as sent but may not have arrived because their
  /// session ended, over all bindings of the node that share the channels (see
  /// BindOptions::is_private). Over shared memory it counts those that the server had not read, and
  /// the last one that it read; elsewhere, those since the server last answered a call over the
  /// same channel. Always an upper bound; it never falls.
  /// @realtime alloc-free, no syscall
  [[nodiscard]] std::uint64_t lost_oneway_count() const noexcept;

  /// Sends a call and returns without waiting for its reply. Copies the request. Allocates the
  /// call's state once.
  /// @errors   those of call(), as far as known before the reply · kNoChannel: too many calls are
  ///           open
  [[nodiscard]] expected<PendingReply, CallError> begin(const MethodDescriptor& method,
                                                        ConstBytes request,
                                                        const CallOptions& options = {});

  /// Calls a method that answers with a stream of items. Copies the request. Allocates the stream's
  /// state once.
  /// @errors   those of begin(); a method that returns no stream fails at the first item
  /// @source   spec/hprotocol.md#hp-5.10
  [[nodiscard]] expected<ItemReader, CallError> open_stream(const MethodDescriptor& method,
                                                            ConstBytes request,
                                                            const StreamOptions& options = {});

  /// Makes an empty call to the server itself. Shows that the path works in both directions at the
  /// call's priority, and estimates the server's clock offset from this call and earlier calls on
  /// the channel. Without an estimate, the uncertainty is Duration::max().
  /// @realtime like call()
  /// @errors   those of call()
  /// @source   spec/hprotocol.md#hp-6.2
  [[nodiscard]] expected<wire::PeerClock, CallError> ping(const CallOptions& options = {}) noexcept;

  /// Opens a channel for the band of each of `priorities`.
  /// @realtime set-up only
  [[nodiscard]] expected<void, SetupError> warm_up(std::span<const Priority> priorities);

  /// The epoch of the server that the last call or oneway went to; it changes with each restart.
  /// @realtime alloc-free
  [[nodiscard]] std::uint64_t server_epoch() const noexcept;
  /// The URL that calls go to now: "rtpm://host:port/path".
  /// @realtime set-up only
  [[nodiscard]] std::string url() const;
  /// How a binding by name has followed the name so far.
  /// @realtime set-up only
  [[nodiscard]] FollowStatus follow_status() const;
  /// The transport of the calls: the requested one, or the best available.
  /// @realtime alloc-free
  [[nodiscard]] Transport transport() const noexcept;

  class Impl;  ///< Internal.

 private:
  explicit Binding(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtpm::rpc
