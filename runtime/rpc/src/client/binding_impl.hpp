#pragma once

#include <atomic>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "client/destinations.hpp"
#include "client/refused.hpp"
#include "local/local.hpp"
#include "rtpm/rpc/binding.hpp"
#include "rtpm/rt/pi_mutex.hpp"
#include "rtpm/wire/limits.hpp"

namespace rtpm::rpc {

/// Makes a binding's calls and, for a binding by name, follows the name.
/// @threads  bind(): one, first; follow() and note_unresolved(): the rebinder; the rest: any
class Binding::Impl {
 public:
  /// @param name  empty for a binding by URL
  Impl(Node& node, const InterfaceDescriptor& interface, const BindOptions& options,
       std::string name);
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;
  ~Impl();

  /// Binds for the first time. A binding by name follows it from now on.
  /// @realtime set-up only
  [[nodiscard]] expected<void, SetupError> bind(const std::string& url, MonotonicTime deadline);
  /// @realtime set-up only
  [[nodiscard]] expected<void, SetupError> warm_up(std::span<const Priority> priorities);
  [[nodiscard]] Destinations& destinations() noexcept { return destinations_; }

  /// The addressee of a call.
  enum class Target : std::uint8_t { kObject, kSession };
  /// The parameters of a call to be sent.
  struct Plan {
    std::uint16_t method = 0;
    bool is_idempotent = false;
    std::optional<Priority> wanted{};
    std::uint64_t trace_id = 0;
    MonotonicTime begun{};  ///< When the call was made.
    MonotonicTime deadline{};
    Target target = Target::kObject;
    wire::Delivery delivery = wire::Delivery::kReply;
    std::uint32_t stream_window = 0;
    Duration stream_silence = wire::kStreamSilence;
    std::optional<Duration> stream_pause_max{};
  };
  /// A channel that is ready for a call, and the call's destination.
  struct Ready {
    CallChannel* channel = nullptr;
    wire::CallParameters parameters{};
    std::uint64_t server_epoch = 0;
    MonotonicTime now{};  ///< When the channel was ready.
  };
  [[nodiscard]] Plan plan(const MethodDescriptor& method,
                          const CallOptions& options) const noexcept;
  /// Takes a channel, and binds again if the server has changed.
  [[nodiscard]] expected<void, CallError> make_ready(const Plan& plan, MonotonicTime now,
                                                     Ready& ready) noexcept;
  [[nodiscard]] expected<ReplyLease, CallError> call(const Plan& plan, ConstBytes request) noexcept;
  /// Repeats a call in the remaining time, if it ended without reply and may be repeated: see
  /// judge().
  [[nodiscard]] expected<ReplyLease, CallError> call_again(const CallOutcome& outcome,
                                                           const Ready& ready, const Plan& plan,
                                                           MonotonicTime begun,
                                                           ConstBytes request) noexcept;

  [[nodiscard]] const std::string& name() const noexcept { return name_; }
  /// Whether the name should be resolved because its server may be gone.
  [[nodiscard]] bool wants_name() const noexcept {
    return wants_name_.load(std::memory_order_acquire);
  }
  void set_wants_name(bool wants) noexcept { wants_name_.store(wants, std::memory_order_release); }
  /// Binds at `url`, to which the name leads. False if the server there does not answer or does not
  /// fit this binding.
  [[nodiscard]] bool follow(const std::string& url);
  /// Records that the name cannot be resolved.
  void note_unresolved(std::string text);
  [[nodiscard]] FollowStatus follow_status() const;

 private:
  /// The maximum number of rounds. Each follows a lost session or connection, and a server that
  /// keeps restarting could cause many.
  static constexpr int kRoundCountMax = 4;
  static constexpr int kNoRefusal = -1;

  /// Does the same on a channel that the caller has taken, for the last bind. `ready` keeps its
  /// null channel if the session was lost meanwhile: try again.
  [[nodiscard]] expected<void, CallError> make_ready_on(CallChannel& channel, const Bound& last,
                                                        Priority priority, const Plan& plan,
                                                        Ready& ready) noexcept;
  /// Decides whether a call that ended without reply may be repeated, and the error for its caller.
  /// `begun`: when it was first sent.
  [[nodiscard]] expected<void, CallError> judge(const CallOutcome& outcome, const Ready& ready,
                                                const Plan& plan, MonotonicTime begun) noexcept;
  [[nodiscard]] expected<ReplyLease, CallError> call_over_transport(const Plan& plan,
                                                                    ConstBytes request) noexcept;
  /// The priority at which a call goes out (hp-6.1-3).
  [[nodiscard]] Priority priority_of(const Plan& plan, const Bound& to) const noexcept;
  /// Calls through the door. Returns nullopt if the call must use a transport.
  [[nodiscard]] std::optional<expected<ReplyLease, CallError>> call_locally(
      const Bound& to, const Plan& plan, ConstBytes request) noexcept;

  [[nodiscard]] bool follows() const noexcept { return !name_.empty(); }
  /// Handles a failure before the call was sent: resolves the name if its server may be gone.
  /// Returns the caller's error: the failure itself, or why the server that the name now leads to
  /// can't be called.
  /// @realtime alloc-free; one syscall for the first failure of an outage
  CallError note_failure(CallError error) noexcept;
  /// Asks the rebinder to resolve the name.
  /// @realtime like note_failure()
  void ask_for_name() noexcept;

  Node& node_;
  const BindOptions options_;
  const InterfaceDescriptor& interface_;
  const Duration default_deadline_;
  const std::uint64_t local_session_ = LocalChannels::next_session();
  const std::string name_;
  Destinations destinations_{follows()};

  // Used only by a binding by name.
  std::atomic<bool> wants_name_{false};
  /// The error of the server that the name leads to, if it can't be called; otherwise kNoRefusal.
  std::atomic<int> refusal_{kNoRefusal};
  mutable rt::PiMutex telling_;  ///< Guards followed_.
  FollowStatus followed_{};
};

}  // namespace rtpm::rpc
