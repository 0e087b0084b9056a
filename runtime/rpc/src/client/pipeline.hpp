#pragma once

#include <array>
#include <memory>
#include <vector>

#include "client/binding_impl.hpp"
#include "client/pending_reply.hpp"
#include "rtpm/rpc/pipeline.hpp"
#include "rtpm/rt/lazy_memory.hpp"
#include "rtpm/wire/limits.hpp"

namespace rtpm::rpc {

class PipelineSession;

/// A pipeline's place for one of its calls, with copies of its request and reply, for as long as a
/// caller asks for it or holds the reply.
class PipelinePlace final : public PendingReply::State {
 public:
  [[nodiscard]] bool is_free() const noexcept { return !is_taken_; }
  [[nodiscard]] bool is_going() const noexcept {
    return is_taken_ && outcome_.kind == CallOutcome::Kind::kGoing;
  }
  /// Begins a call here.
  /// @errors   kTooLarge, kDisconnected: the place is free
  [[nodiscard]] expected<void, CallError> begin(Binding::Impl& binding,
                                                const Binding::Impl::Plan& plan,
                                                const Binding::Impl::Ready& ready,
                                                ConstBytes request) noexcept;
  /// Ends the call here.
  void end(const CallOutcome& outcome) noexcept;

  [[nodiscard]] bool wait(MonotonicTime until) noexcept override;
  [[nodiscard]] expected<ReplyLease, CallError> take() noexcept override;
  void cancel() noexcept override;
  void drop() noexcept override;
  /// Frees the reply, which is no longer held.
  void release() noexcept;

 private:
  friend class Pipeline::Impl;

  PipelineSession* session_ = nullptr;
  bool is_taken_ = false;
  bool is_leased_ = false;
  Binding::Impl* binding_ = nullptr;
  Binding::Impl::Plan plan_{};
  Binding::Impl::Ready ready_{};
  wire::CallIndex call_ = 0;
  MonotonicTime begun_{};
  ConstBytes request_{};
  CallOutcome outcome_{};
  rt::LazyMemory request_room_;
  rt::LazyMemory reply_room_;
};

/// A channel that a pipeline has taken, and its calls there.
class PipelineSession {
 public:
  PipelineSession(Pipeline::Impl& pipeline_in, Endpoint& endpoint_in, CallChannel* taken) noexcept
      : pipeline(pipeline_in), endpoint(endpoint_in), channel(taken) {}

  [[nodiscard]] PipelinePlace* free_place() noexcept;
  /// Calls wait for others to go with.
  [[nodiscard]] bool has_held() const noexcept { return channel->has_held(); }
  /// No call of it is on its way.
  [[nodiscard]] bool is_idle() const noexcept;
  /// No call is on its way, and no reply is held.
  [[nodiscard]] bool is_free() const noexcept;
  /// Notes a begun call, which may be the first one held. Sends the held calls if they are many or
  /// have waited for long.
  void note_held(bool is_first, MonotonicTime begun) noexcept;
  /// Takes the frames that came together with the one that was taken last.
  void take_buffered() noexcept;
  /// Gives the outcome to its call, or keeps it until that asks.
  void settle(const CallOutcome& outcome) noexcept;
  void end_all(const CallOutcome& outcome) noexcept;

  Pipeline::Impl& pipeline;
  Endpoint& endpoint;
  TakenChannel channel;
  MonotonicTime held_since{};  ///< When the first of the calls was begun that have not gone yet,
  std::size_t held_count = 0;  ///< and how many these are.
  std::array<PipelinePlace, wire::kCallWindow> places{};
  std::array<PipelinePlace*, wire::kCallWindow> by_call{};
};

class Pipeline::Impl {
 public:
  Impl() = default;
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;
  ~Impl();

  [[nodiscard]] expected<PipelinePlace*, CallError> begin(Binding::Impl& binding,
                                                          const Binding::Impl::Plan& plan,
                                                          ConstBytes request) noexcept;
  void flush() noexcept;
  /// Sends the calls that have waited long enough for others; gives when the next ones are due.
  [[nodiscard]] MonotonicTime flush_due(MonotonicTime now) noexcept;
  [[nodiscard]] std::size_t open_count() const noexcept;

 private:
  [[nodiscard]] bool can_take(PipelineSession& session, const Endpoint& endpoint, Priority priority,
                              std::uint64_t server_epoch) noexcept;
  [[nodiscard]] expected<PipelineSession*, CallError> session_for(
      Endpoint& endpoint, Priority priority, std::uint64_t server_epoch) noexcept;

  std::vector<std::unique_ptr<PipelineSession>> sessions_;
  std::size_t last_ = 0;  ///< The session that had the last call: it is filled first.
};

}  // namespace rtpm::rpc
