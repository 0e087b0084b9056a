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
  /// How long the caller waits, from now on. By default the method's deadline, or the node's;
  /// within a method never longer than that method's own caller waits.
  std::optional<Duration> deadline{};
  /// Passed on to the servant to trace one action across programs. In a method, 0 is its caller's.
  std::uint64_t trace_id = 0;
};

inline constexpr std::uint32_t kMissCountMin = 2;
inline constexpr std::uint32_t kMissCountMax = 6;

/// How a stream is taken.
struct StreamOptions {
  /// The options of the call. The deadline is the whole stream's; there is none by default.
  CallOptions call{};
  /// How many items may be on their way at a time, 1…32: how far the server may be ahead.
  std::uint32_t window = 16;
  /// A reader that waits in next() asks the server at least each half second whether it is there.
  /// How many answers in a row may be missing, kMissCountMin…kMissCountMax, until the stream ends.
  /// @source   spec/hprotocol.md#hp-5.10-7
  std::uint32_t miss_count_max = kMissCountMax;
  /// How long the reader may go without calling next(); until then the server holds the items that
  /// it has not sent. After that the server ends the stream, which next() reports as kStreamLost.
  /// Default: over TCP and shared memory, as long as the connection lasts; over UDP 10 s, and 30 s
  /// at most.
  std::optional<Duration> pause_max{};
};

/// How a binding is made.
struct BindOptions {
  Transport transport = Transport::kAuto;
  /// How long bind() may take, the registry's answer included.
  Duration deadline = std::chrono::seconds{1};
  /// The priorities that calls will have: a channel of each band is opened now, so that the first
  /// call is as fast as the thousandth. Empty for all, up to the server's ceiling.
  std::vector<Priority> warm_up{};
  /// The binding shares its channels with no other binding of the node.
  /// @source   RT-CORBA's private connections
  bool is_private = false;
};

/// A reply's bytes and the call channel that holds them; the channel is given back when this ends,
/// so do not keep it.
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

  /// The reply's payload, aligned to 16 bytes; valid as long as this lives.
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

/// How a binding by name follows it.
struct FollowStatus {
  std::uint64_t resolve_count = 0;  ///< How often the name was looked up since the bind,
  std::uint64_t move_count = 0;     ///< and how often it led to another URL, where calls go since.
  /// Why calls can't go where the name leads: it is not bound, its server does not answer or has
  /// another interface. Empty if they can, as far as is known.
  std::string trouble{};
};

/// An object of some server, bound: what every generated stub holds.
///
/// A binding by name follows the name. When a call finds its server gone (unreachable, silent,
/// stopped, restarted, another program at its address), the node looks up where the name leads and
/// binds there, on its own time-shared thread "rtpm-rebind"; calls go on to the new server from
/// then on. Meanwhile they fail at once, or at their deadline, with the errors of the server that
/// is gone; none is made again at the new server unless it is idempotent or was not sent. A server
/// that has another interface is not taken: calls give kWrongInterface or kNoSuchMethod, and
/// follow_status() says why. The bindings of a node to one name share a look-up: at most one in a
/// second, at least one in four seconds until the name leads to a server that answers.
/// A server that restarts at its old address is found by the next call itself, with or without a
/// name.
///
/// @ownership refers to its node, which must outlive it; by name, to the node's resolver, too. Its
///           end waits for a bind of it that is under way, for 1 s at most
/// @threads  calls from any, several at once (each takes a call channel of its own)
/// @realtime as each call says: looking a name up and binding again take place on "rtpm-rebind"
///           only, never in a caller's thread; the first call of an outage makes one syscall more
class Binding {
 public:
  /// Binds `target`, a URL "rtpm://host:port/path" or a name for the node's resolver, checks that
  /// the object has `interface`, and opens the channels of `options.warm_up`.
  /// @realtime set-up only
  /// @errors   no resolver, unknown name, no server there, refused, or an interface that differs
  ///           (the text says in which method)
  [[nodiscard]] static expected<Binding, SetupError> bind(Node& node, std::string_view target,
                                                          const InterfaceDescriptor& interface,
                                                          const BindOptions& options = {});
  Binding(Binding&&) noexcept;
  Binding& operator=(Binding&&) noexcept;
  ~Binding();

  /// Calls `method` with the encoded `request` and waits for the reply on this thread; no other
  /// thread takes part. The server runs it at most once, however often the network loses or repeats
  /// frames.
  /// @realtime alloc-free once the band of the priority is open; one send and one receive per try,
  ///           plus what the wait strategy needs to block
  /// @errors   as CallError says
  [[nodiscard]] expected<ReplyLease, CallError> call(const MethodDescriptor& method,
                                                     ConstBytes request,
                                                     const CallOptions& options = {}) noexcept;

  /// Calls `method`, which gives nothing back, and waits only as long as `delivery` says: not at
  /// all (kSent), until the server has it and is about to run it, or until it ran. A request that
  /// does not fit a frame is always confirmed. With kSent, ok never means that the method ran:
  ///
  /// - kSharedMemory: ok means that it is in the server's ring. The first send() later than 1 ms
  ///   after the server's end reports the loss.
  /// - kTcp: the kernel has it, and sends in order. The loss is reported in the same way, once the
  ///   kernel knows that the connection ended: 3 s after a host vanished.
  /// - kUdp: it left this host, if the kernel did not drop it. The loss of a session is reported
  ///   when the server's host, or the server's next life, answers that it is not there; the loss of
  ///   single datagrams is never reported.
  /// - kLocal: it waits in the server's lane. Oneways that wait when the server stops end with it.
  ///
  /// A loss is reported as kMaybeLost, by the next send() of this binding or by check_oneways().
  ///
  /// @realtime as call(); kSent takes one system call more each millisecond, over shared memory
  ///           each 50 µs while the server has not read what was sent
  /// @errors   as call(); a oneway of one frame by kSent was not sent if there is an error;
  ///           kMaybeLost: earlier ones may not have arrived either, see lost_oneway_count();
  ///           kOverload: the host's own buffer is full, or over kLocal as many oneways as
  ///           ServerConfig::local_oneway_count_max wait or run already: send less often
  /// @source   spec/hprotocol.md#hp-5.8; CORBA's SyncScope
  [[nodiscard]] expected<void, CallError> send(const MethodDescriptor& method, ConstBytes request,
                                               wire::Delivery delivery,
                                               const CallOptions& options = {}) noexcept;

  /// Checks, without sending, whether oneways that were merely sent may not have arrived: for a
  /// caller that sends no more of them. Channels that other threads use meanwhile are left out.
  /// @realtime alloc-free, at most two syscalls per channel with unconfirmed oneways
  /// @errors   kMaybeLost, once
  [[nodiscard]] expected<void, CallError> check_oneways() noexcept;
  /// The number of oneways to the server that were reported as sent and may not have arrived,
  /// because their session ended, over all bindings of the node that share the channels (see
  /// BindOptions::is_private). Over shared memory it counts those that the server had not read, and
  /// the one that it read last; elsewhere those since the server last answered a call over the same
  /// channel. Always an upper bound; it never falls.
  /// @realtime alloc-free, no syscall
  [[nodiscard]] std::uint64_t lost_oneway_count() const noexcept;

  /// Begins a call and returns; its reply is waited for later. The request is copied. Allocates the
  /// call's state, once.
  /// @errors   as call(), as far as they show before the reply; kNoChannel: too many are open
  [[nodiscard]] expected<PendingReply, CallError> begin(const MethodDescriptor& method,
                                                        ConstBytes request,
                                                        const CallOptions& options = {});

  /// Calls a method that answers with a stream of items. The request is copied. Allocates the
  /// stream's state, once.
  /// @errors   as begin(); that the method gives no stream shows at the first item
  /// @source   spec/hprotocol.md#hp-5.10
  [[nodiscard]] expected<ItemReader, CallError> open_stream(const MethodDescriptor& method,
                                                            ConstBytes request,
                                                            const StreamOptions& options = {});

  /// Makes an empty call to the server itself, which shows that the path works in both directions
  /// at the call's priority, and estimates the offset of the server's clock from this host's by
  /// this call and earlier ones on the same channel. If none of them gives an estimate, the
  /// uncertainty is Duration::max().
  /// @realtime as call()
  /// @errors   as call()
  /// @source   spec/hprotocol.md#hp-6.2
  [[nodiscard]] expected<wire::PeerClock, CallError> ping(const CallOptions& options = {}) noexcept;

  /// Opens a channel of the band that serves each of `priorities`.
  /// @realtime set-up only
  [[nodiscard]] expected<void, SetupError> warm_up(std::span<const Priority> priorities);

  /// The epoch of the server that the last call or oneway went to; another number in each life.
  /// @realtime alloc-free
  [[nodiscard]] std::uint64_t server_epoch() const noexcept;
  /// Where calls go now: "rtpm://host:port/path".
  /// @realtime set-up only
  [[nodiscard]] std::string url() const;
  /// How a binding by name has followed the name so far.
  /// @realtime set-up only
  [[nodiscard]] FollowStatus follow_status() const;
  /// The transport of the calls: the one that was asked for, or the best one.
  /// @realtime alloc-free
  [[nodiscard]] Transport transport() const noexcept;

  class Impl;  ///< The library's own.

 private:
  explicit Binding(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtpm::rpc
