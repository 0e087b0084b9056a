#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/expected.hpp"
#include "rtpm/base/priority.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/rpc/async.hpp"
#include "rtpm/rpc/error.hpp"
#include "rtpm/rpc/interface.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rpc/pipeline.hpp"
#include "rtpm/wire/client_channel.hpp"
#include "rtpm/wire/clock_sync.hpp"

namespace rtpm::rpc {

/// What one call may state; every field has a default.
struct CallOptions {
  /// The call's priority; default: the calling thread's current_priority(), else the object's.
  std::optional<Priority> priority{};
  /// How long the caller waits, from now on; default: the method's, else the node's, but in a
  /// method not longer than its own caller waits.
  std::optional<Duration> deadline{};
  /// Passed on to the servant, to follow one action across programs; in a method, 0 is its own's.
  std::uint64_t trace_id = 0;
  /// Of begin_x(): the calls with which this one shares sessions. Others do not heed it.
  Pipeline* pipeline = nullptr;
};

inline constexpr std::uint32_t kMissCountMin = 2;
inline constexpr std::uint32_t kMissCountMax = 6;

/// How a stream is taken.
struct StreamOptions {
  /// As for any call; the deadline is the whole stream's. Default: none.
  CallOptions call{};
  /// How many items may be on their way at a time, 1…32: how far the server may be ahead.
  std::uint32_t window = 16;
  /// Caller and server hear of each other at least each half second. How many signs of life in a
  /// row may be missing, kMissCountMin…kMissCountMax, until each takes the other for dead. The
  /// caller gives its own only while it waits in next().   Source: spec/hprotocol.md#hp-5.10-7.
  std::uint32_t miss_count_max = kMissCountMax;
};

/// How a binding is made.
struct BindOptions {
  Transport transport = Transport::kAuto;
  /// How long bind() may take, the registry's answer included.
  Duration deadline = std::chrono::seconds{1};
  /// The priorities that calls will have: a channel of each band is opened now, so that the first
  /// call is as fast as the thousandth. Empty: all, up to the server's ceiling.
  std::vector<Priority> warm_up{};
  /// The binding shares its channels with no other of the node.   Source: RT-CORBA's private
  /// connections.
  bool is_private = false;
};

/// A reply's bytes and the call channel that holds them; the channel is given back when this ends,
/// so do not keep it.
/// Threads: one at a time.   RT: alloc-free.
class ReplyLease {
 public:
  ReplyLease() noexcept = default;
  ReplyLease(ReplyLease&& other) noexcept { *this = std::move(other); }
  ReplyLease& operator=(ReplyLease&& other) noexcept {
    std::swap(bytes_, other.bytes_);
    std::swap(channel_, other.channel_);
    std::swap(local_, other.local_);
    std::swap(place_, other.place_);
    return *this;
  }
  ~ReplyLease();

  /// The reply's payload, aligned to 16 bytes; valid as long as this lives.
  [[nodiscard]] ConstBytes bytes() const noexcept { return bytes_; }

 private:
  friend class Binding;
  friend class PendingReply;
  friend class PipelinePlace;
  friend class expected<ReplyLease, CallError>;
  ReplyLease(ConstBytes bytes, class CallChannel* channel) noexcept
      : bytes_(bytes), channel_(channel) {}
  ReplyLease(ConstBytes bytes, class LocalChannel& channel) noexcept
      : bytes_(bytes), local_(&channel) {}
  ReplyLease(ConstBytes bytes, class PipelinePlace& place) noexcept
      : bytes_(bytes), place_(&place) {}

  ConstBytes bytes_{};
  class CallChannel* channel_ = nullptr;
  class LocalChannel* local_ = nullptr;
  class PipelinePlace* place_ = nullptr;
};

/// An object of some server, bound: what every generated stub holds.
/// Ownership: refers to its node, which must outlive it.
/// Threads: calls from any thread, several at once (each takes a call channel of its own).
class Binding {
 public:
  /// Binds `target`, a URL "rtpm://host:port/path" or a name for the node's resolver, checks that
  /// the object has `interface`, and opens the channels of `options.warm_up`.   Set-up only.
  /// Errors: no resolver, unknown name, nobody there, refused, or an interface that differs (the
  /// text says in which method).
  [[nodiscard]] static expected<Binding, SetupError> bind(Node& node, std::string_view target,
                                                          const InterfaceDescriptor& interface,
                                                          const BindOptions& options = {});
  Binding(Binding&&) noexcept;
  Binding& operator=(Binding&&) noexcept;
  ~Binding();

  /// Calls `method` with the encoded `request` and waits for the reply, on this thread, without any
  /// other. At most one run on the server, however often the network loses or repeats.
  /// RT: alloc-free once the band of the priority is open; one send and one receive per try, plus
  /// what the wait strategy needs to block.
  /// Errors: as CallError says.
  [[nodiscard]] expected<ReplyLease, CallError> call(const MethodDescriptor& method,
                                                     ConstBytes request,
                                                     const CallOptions& options = {}) noexcept;

  /// Calls `method`, which gives nothing back, and waits only as long as `delivery` says: not at
  /// all, until the server has it and is about to run it, or until it ran. What does not fit a
  /// frame is never merely sent, but confirmed. RT: as call().   Errors: as call(); what was merely
  /// sent may be lost without any, and over Transport::kLocal gives kOverload where
  /// ServerConfig::local_oneway_count_max of them wait or run already: send less often.
  /// Source: spec/hprotocol.md#hp-5.8; CORBA's SyncScope.
  [[nodiscard]] expected<void, CallError> send(const MethodDescriptor& method, ConstBytes request,
                                               wire::Delivery delivery,
                                               const CallOptions& options = {}) noexcept;

  /// Begins a call and returns; its reply is waited for later. The request is copied.
  /// Allocates the call's state, once, unless the call is one of a pipeline, which has it.
  /// Errors: as call(), as far as they show before the reply; kNoChannel: too many are open.
  [[nodiscard]] expected<PendingReply, CallError> begin(const MethodDescriptor& method,
                                                        ConstBytes request,
                                                        const CallOptions& options = {});

  /// Calls a method that answers with a stream of items. The request is copied. Allocates the
  /// stream's state, once.   Errors: as begin(); that the method gives no stream shows at the first
  /// item.   Source: spec/hprotocol.md#hp-5.10.
  [[nodiscard]] expected<ItemReader, CallError> open_stream(const MethodDescriptor& method,
                                                            ConstBytes request,
                                                            const StreamOptions& options = {});

  /// Makes an empty call to the server itself, which shows that the path works in both directions
  /// at the call's priority, and tells how the server's clock stands to ours: by this call and
  /// those before it on the same channel. Where none of them tells, the uncertainty is
  /// Duration::max(). RT: as call().   Errors: as call().   Source: spec/hprotocol.md#hp-6.2.
  [[nodiscard]] expected<wire::PeerClock, CallError> ping(const CallOptions& options = {}) noexcept;

  /// Opens a channel of the band that serves each of `priorities`.   Set-up only.
  [[nodiscard]] expected<void, SetupError> warm_up(std::span<const Priority> priorities);

  /// Where the object is: "rtpm://host:port/path".
  [[nodiscard]] std::string_view url() const noexcept;
  /// Over what the calls go: what was asked for, or what was best.   RT: alloc-free.
  [[nodiscard]] Transport transport() const noexcept;

 private:
  friend class PendingReply;
  friend class ItemReader;
  friend class Pipeline;
  friend class PipelinePlace;
  class Impl;
  explicit Binding(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtpm::rpc
