#pragma once

#include <array>
#include <atomic>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "client/call_channel.hpp"
#include "client/endpoint.hpp"
#include "client/refused.hpp"
#include "local/local.hpp"
#include "rtpm/base/assert.hpp"
#include "rtpm/base/latest.hpp"
#include "rtpm/rpc/binding.hpp"
#include "rtpm/rt/pi_mutex.hpp"
#include "rtpm/transport/address.hpp"
#include "rtpm/wire/control.hpp"
#include "rtpm/wire/limits.hpp"
#include "rtpm/wire/url.hpp"

namespace rtpm::rpc {

/// When a caller's patience ends, which may be longer than all time that is left.
[[nodiscard]] MonotonicTime deadline_after(Duration patience, MonotonicTime now) noexcept;

/// Whether a server that was reached will not serve this binding: only another one could.
[[nodiscard]] bool is_refusal(std::error_code cause) noexcept;

/// A binding's object as calls reach it. Constant once it is made.
struct Destination {
  Destination(Node& node_in, Endpoint& endpoint_in, std::string path_in, std::string url_in)
      : node(node_in), endpoint(endpoint_in), path(std::move(path_in)), url(std::move(url_in)) {}
  Destination(const Destination&) = delete;
  Destination& operator=(const Destination&) = delete;
  ~Destination();

  Node& node;
  Endpoint& endpoint;
  std::string path;
  std::string url;
  /// Null unless the object's server is in this program.
  std::shared_ptr<LocalDoor> door{};
  // Oneways lost on the way to the binding's former destinations, and of the endpoint's those that
  // were lost before the binding came to it.
  std::uint64_t lost_before = 0;
  std::uint64_t lost_elsewhere = 0;
  [[nodiscard]] std::uint64_t lost_oneway_count() const noexcept {
    return lost_before + endpoint.lost_oneway_count() - lost_elsewhere;
  }
};

/// The result of a bind; true as long as the server's epoch is the same.
struct Bound {
  const Destination* destination = nullptr;
  std::uint64_t server_epoch = 0;
  std::uint32_t service = 0;
  Priority priority{};
  bool is_server_declared = false;
  std::uint64_t fingerprint = 0;  ///< The server's fingerprint of the interface.
};

/// The outcome of asking a server for an object.
struct BindOutcome {
  CallOutcome::Kind kind = CallOutcome::Kind::kFailed;
  CallError error = CallError::kTimeout;
  Bound bound{};
  wire::Status status = wire::Status::kOk;
  std::string difference{};  ///< In the interface; empty if it is the same or compatible.
  std::array<char, 96> other_interface{};
  /// If the object is not there: the paths most like its own, as the server sent them.
  std::array<std::byte, wire::kSimilarPathCountMax*(wire::kPathSizeMax + 2)> similar_paths{};
  std::size_t similar_paths_size = 0;
};

class Binding::Impl {
 public:
  Impl(Node& node_in, const InterfaceDescriptor& interface_in, const BindOptions& bind_options_in)
      : node(node_in),
        bind_options(bind_options_in),
        interface(interface_in),
        default_deadline(node_in.config().default_deadline) {}
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;
  ~Impl();

  /// Keeps the destinations that remembered() gives. Costs a binding by URL nothing, as that has
  /// one for its life.
  class Pin {
   public:
    explicit Pin(Impl& binding) noexcept
        : count_(binding.follows() ? &binding.pin_count : nullptr) {
      // SYNC POINT binding-destinations: a pin that the count does not show yet sees the newest.
      if (count_ != nullptr) count_->fetch_add(1, std::memory_order_acq_rel);
    }
    Pin(const Pin&) = delete;
    Pin& operator=(const Pin&) = delete;
    ~Pin() {
      if (count_ != nullptr) count_->fetch_sub(1, std::memory_order_release);
    }

   private:
    std::atomic<std::uint32_t>* count_;
  };

  /// Each round follows a lost session or connection, of which a server that keeps restarting could
  /// make many.
  static constexpr int kRoundCountMax = 4;

  /// Asks for the object.
  /// @realtime alloc-free, unless the server has a version of the interface that this binding has
  ///           not met yet: then it compares the two
  [[nodiscard]] BindOutcome ask(const Destination& at, CallChannel& channel, Priority priority,
                                MonotonicTime deadline) noexcept;

  /// A destination that answers, with sessions for the calls to come.
  struct Opened {
    std::unique_ptr<Destination> destination;
    Bound bound{};
  };
  /// Tries the hosts of the URL, and the addresses of their names, one after the other, each with
  /// its part of the time that is left.
  [[nodiscard]] expected<Opened, SetupError> open(const std::string& at_url,
                                                  MonotonicTime deadline);
  /// A known server over UDP or TCP by sealed sessions, with each key that it may have.
  [[nodiscard]] expected<Opened, SetupError> open_at(const ServerCandidate& server,
                                                     const std::string& path,
                                                     const std::string& at_url,
                                                     MonotonicTime deadline);
  [[nodiscard]] expected<Opened, SetupError> open_over(const ServerAddress& address,
                                                       const std::string& path,
                                                       const std::string& at_url,
                                                       MonotonicTime deadline);
  [[nodiscard]] expected<Opened, SetupError> open_by(const ServerAddress& address,
                                                     const std::string& path,
                                                     const std::string& at_url,
                                                     MonotonicTime deadline);
  [[nodiscard]] expected<Bound, SetupError> open_session(Destination& at,
                                                         const InterfaceDescriptor& wanted,
                                                         MonotonicTime deadline);
  /// Directs calls there from now on.
  void settle(Opened opened);
  /// Frees former destinations, unless a call that began before looks at them; true if none is
  /// left.
  [[nodiscard]] bool free_former() noexcept;
  [[nodiscard]] bool follows() const noexcept { return !name.empty(); }
  /// Handles a call's failure before it was sent: looks the name up if its server may be gone.
  /// Gives the error for the caller: the failure itself, or why the server that the name leads to
  /// by now can't be called.
  /// @realtime alloc-free; one syscall for the first of an outage
  CallError note_failure(CallError error) noexcept;
  /// Lets the node look up where the name leads.
  /// @realtime as note_failure()
  void ask_for_name() noexcept;
  /// Binds at `at_url`, to which the name leads; false if the server there does not answer, or is
  /// not one for this binding.
  /// @threads  the rebinder's
  [[nodiscard]] bool follow(const std::string& at_url);
  /// The name leads nowhere.
  /// @threads  the rebinder's
  void note_unresolved(std::string text);
  /// The addressee of a call.
  enum class Target : std::uint8_t { kObject, kSession };
  /// The parameters with which a call goes out.
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
    Duration stream_silence = wire::kStreamSilence;
    std::optional<Duration> stream_pause_max{};
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
  /// Does so on a channel that the caller has taken, for the last bind. `ready` keeps its null
  /// channel if the session was lost meanwhile: try again.
  [[nodiscard]] expected<void, CallError> make_ready_on(CallChannel& channel, const Bound& last,
                                                        Priority priority, const Plan& plan,
                                                        Ready& ready) noexcept;
  /// Decides whether a call that ended without reply may be made again, and the error for its
  /// caller. `begun`: when it was sent first.
  [[nodiscard]] expected<void, CallError> judge(const CallOutcome& outcome, const Ready& ready,
                                                const Plan& plan, MonotonicTime begun) noexcept;
  [[nodiscard]] expected<ReplyLease, CallError> call(const Plan& plan, ConstBytes request) noexcept;
  /// Makes a call again in the time that is left, if it ended without reply and may be made again:
  /// see judge().
  [[nodiscard]] expected<ReplyLease, CallError> call_again(const CallOutcome& outcome,
                                                           const Ready& ready, const Plan& plan,
                                                           MonotonicTime begun,
                                                           ConstBytes request) noexcept;
  [[nodiscard]] expected<ReplyLease, CallError> call_over_transport(const Plan& plan,
                                                                    ConstBytes request) noexcept;
  /// The priority with which a call goes out (hp-6.1-3).
  [[nodiscard]] Priority priority_of(const Plan& plan, const Bound& to) const noexcept;
  /// Whether oneways to the server may have been lost since this was last asked, and this binding
  /// has sent some.
  /// @realtime alloc-free, no syscall
  [[nodiscard]] bool has_lost_oneways() noexcept;
  /// Calls through the door; nothing if the call has to go over a transport.
  [[nodiscard]] std::optional<expected<ReplyLease, CallError>> call_locally(
      const Bound& to, const Plan& plan, ConstBytes request) noexcept;
  /// `transport_error`: see CallChannel::transport_error().
  [[nodiscard]] static expected<void, CallError> warm_up(Endpoint& endpoint,
                                                         std::span<const Priority> priorities,
                                                         MonotonicTime deadline,
                                                         SetupError& transport_error);
  /// Does what warm_up() does, for each band that the server has.
  [[nodiscard]] static expected<void, CallError> warm_up_all(Endpoint& endpoint,
                                                             MonotonicTime deadline,
                                                             SetupError& transport_error);
  /// Another life of the server at the destination. It counts for nothing if calls go elsewhere
  /// meanwhile.
  void remember(const Bound& value) noexcept {
    const std::lock_guard lock(writing);
    if (value.destination == current) bound.write(value);
  }
  [[nodiscard]] Bound remembered() noexcept {
    if (const auto value = bound.read()) return *value;
    // Overtaken by write after write, which the lock keeps out.
    const std::lock_guard lock(writing);
    const auto value = bound.read();
    RTPM_ASSERT(value.has_value(), "a binding was bound before its first call");
    return *value;
  }

  Node& node;
  const BindOptions bind_options;
  std::uint64_t local_session = LocalChannels::next_session();
  const InterfaceDescriptor& interface;
  const Duration default_deadline;
  Latest<Bound> bound;
  rt::PiMutex writing;                     ///< Guards bound and current.
  const Destination* current = nullptr;    ///< The destination of bound.
  std::unique_ptr<Destination> settled{};  ///< Owns the destination of bound.
  std::atomic<bool> has_door{false};       ///< Whether the destination has a door.

  // Used only by a binding by name. Written by the thread that binds, later by the Rebinder.
  std::string name{};
  std::vector<std::unique_ptr<Destination>> former{};
  std::atomic<std::uint32_t> pin_count{0};
  std::atomic<bool> asks_for_name{false};
  /// The error of the server that the name leads to, if that can't be called; kNoRefusal otherwise.
  std::atomic<int> refusal{kNoRefusal};
  static constexpr int kNoRefusal = -1;
  rt::PiMutex telling;  ///< Guards followed.
  FollowStatus followed{};

  std::atomic<bool> sends_oneways{false};
  /// How much of lost_oneway_count() has been reported to the binding's callers.
  std::atomic<std::uint64_t> lost_oneways_told{0};
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
