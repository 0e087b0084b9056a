#pragma once

#include <array>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "call_channel.hpp"
#include "endpoint.hpp"
#include "local.hpp"
#include "rtpm/base/assert.hpp"
#include "rtpm/base/latest.hpp"
#include "rtpm/rpc/binding.hpp"
#include "rtpm/rt/pi_mutex.hpp"
#include "rtpm/wire/control.hpp"
#include "rtpm/wire/limits.hpp"

namespace rtpm::rpc {

/// When a caller's patience ends, which may be longer than all time that is left.
[[nodiscard]] MonotonicTime deadline_after(Duration patience, MonotonicTime now) noexcept;

/// The caller's word for a status that is not ok.
[[nodiscard]] CallError error_of(wire::Status status) noexcept;

/// What a bind learned; true as long as the server's epoch is the same.
struct Bound {
  std::uint64_t server_epoch = 0;
  std::uint32_t service = 0;
  Priority priority{};
  bool is_server_declared = false;
  std::uint64_t fingerprint = 0;  ///< Of the server's view of the interface.
};

/// What came of asking a server for an object. `what` is for a person.
struct BindOutcome {
  CallOutcome::Kind kind = CallOutcome::Kind::kFailed;
  CallError error = CallError::kTimeout;
  Bound bound{};
  wire::Status status = wire::Status::kOk;
  std::string difference{};  ///< In the interface; empty: it is the same, or one that will do.
  std::array<char, 96> other_interface{};
};

class Binding::Impl {
 public:
  Impl(Node& node_in, Endpoint& endpoint_in, std::string path_in, std::string url_in,
       const InterfaceDescriptor& interface_in, Duration default_deadline_in)
      : node(node_in),
        endpoint(endpoint_in),
        path(std::move(path_in)),
        url(std::move(url_in)),
        interface(interface_in),
        default_deadline(default_deadline_in) {}
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;
  ~Impl();

  /// Each round follows a lost session or connection, of which a server that keeps restarting could
  /// make many.
  static constexpr int kRoundCountMax = 4;

  /// Asks for the object. RT: alloc-free, unless the server has a version of the interface that
  /// this binding has not met yet: then it compares the two.
  [[nodiscard]] BindOutcome ask(CallChannel& channel, Priority priority,
                                MonotonicTime deadline) noexcept;
  /// Whom a call goes to.
  enum class Target : std::uint8_t { kObject, kSession };
  /// What a call goes out with.
  struct Plan {
    std::uint16_t method = 0;
    bool is_idempotent = false;
    std::optional<Priority> wanted{};
    std::uint64_t trace_id = 0;
    MonotonicTime begun{};  ///< When it was made.
    MonotonicTime deadline{};
    Target target = Target::kObject;
    wire::Delivery delivery = wire::Delivery::kReply;
    std::uint32_t stream_window = 0;
    Duration stream_lease = wire::kStreamLease;
  };
  /// A channel that is ready for a call, and what to call there.
  struct Ready {
    CallChannel* channel = nullptr;
    wire::CallParameters parameters{};
    std::uint64_t server_epoch = 0;
    MonotonicTime now{};  ///< When it was ready.
  };
  [[nodiscard]] Plan plan(const MethodDescriptor& method,
                          const CallOptions& options) const noexcept;
  /// Takes a channel and binds again where the server is another one.
  [[nodiscard]] expected<void, CallError> make_ready(const Plan& plan, MonotonicTime now,
                                                     Ready& ready) noexcept;
  /// The same on a channel that the caller has taken, for what was bound last. `ready` keeps its
  /// null channel where the session was lost meanwhile: try again.
  [[nodiscard]] expected<void, CallError> make_ready_on(CallChannel& channel, const Bound& last,
                                                        Priority priority, const Plan& plan,
                                                        Ready& ready) noexcept;
  /// What a call that ended without reply means for its caller: whether it may be made again.
  /// `begun`: when it was sent first.
  [[nodiscard]] expected<void, CallError> judge(const CallOutcome& outcome, const Ready& ready,
                                                const Plan& plan, MonotonicTime begun) noexcept;
  [[nodiscard]] expected<ReplyLease, CallError> call(const Plan& plan, ConstBytes request) noexcept;
  /// The same, for what is left of the time, after a call that was begun ended without reply, if it
  /// may be made again: see judge().
  [[nodiscard]] expected<ReplyLease, CallError> call_again(const CallOutcome& outcome,
                                                           const Ready& ready, const Plan& plan,
                                                           MonotonicTime begun,
                                                           ConstBytes request) noexcept;
  /// The priority with which a call goes out (hp-6.1-3).
  [[nodiscard]] Priority priority_of(const Plan& plan, const Bound& to) const noexcept;
  /// Calls through the door; nothing if the call has to go over a transport.
  [[nodiscard]] std::optional<expected<ReplyLease, CallError>> call_locally(
      const Plan& plan, ConstBytes request) noexcept;
  [[nodiscard]] expected<void, CallError> warm_up(std::span<const Priority> priorities,
                                                  MonotonicTime deadline) noexcept;
  /// The same for each band that the server has.
  [[nodiscard]] expected<void, CallError> warm_up_all(MonotonicTime deadline) noexcept;
  void remember(const Bound& value) noexcept {
    const std::lock_guard lock(writing);
    bound.write(value);
  }
  [[nodiscard]] Bound remembered() noexcept {
    if (const auto value = bound.read()) return *value;
    // We keep a less urgent thread from ending its write; waiting for it lends it our priority.
    const std::lock_guard lock(writing);
    const auto value = bound.read();
    RTPM_ASSERT(value.has_value(), "a binding was bound before its first call");
    return *value;
  }

  Node& node;
  Endpoint& endpoint;
  bool is_private = false;
  /// Where the object's server is in this program; else null.
  std::shared_ptr<LocalDoor> door{};
  std::uint64_t local_session = LocalChannels::next_session();
  std::string path;
  std::string url;
  const InterfaceDescriptor& interface;
  Duration default_deadline;
  Latest<Bound> bound;
  rt::PiMutex writing;
};

/// Gives the channel back unless a reply lease takes that over.
class TakenChannel {
 public:
  explicit TakenChannel(CallChannel* channel) noexcept : channel_(channel) {}
  TakenChannel(const TakenChannel&) = delete;
  TakenChannel& operator=(const TakenChannel&) = delete;
  ~TakenChannel() {
    if (channel_ != nullptr) channel_->release();
  }
  [[nodiscard]] CallChannel& operator*() const noexcept { return *channel_; }
  [[nodiscard]] CallChannel* operator->() const noexcept { return channel_; }
  [[nodiscard]] CallChannel* keep() noexcept { return std::exchange(channel_, nullptr); }

 private:
  CallChannel* channel_;
};

}  // namespace rtpm::rpc
