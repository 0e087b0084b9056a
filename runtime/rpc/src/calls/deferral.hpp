#pragma once

#include <memory>

#include "calls/pending.hpp"
#include "rtpm/base/assert.hpp"

namespace rtpm::rpc {

/// Lets the running method answer later, if its call has, or gets, a slot among the pending calls.
class CallDeferral final : public Deferral {
 public:
  /// Constructs it for a call that must be answered at once.
  CallDeferral() noexcept = default;
  /// Constructs it for a call over a transport. `kept` is the call's slot, if it already has one.
  CallDeferral(const std::shared_ptr<PendingPool>& pool, const wire::Request& request,
               wire::ServerSessions& sessions, PendingCall* kept = nullptr) noexcept
      : pool_(&pool), request_(&request), sessions_(&sessions), call_(kept) {}
  /// Constructs it for a call within this program, which uses the caller's memory.
  CallDeferral(const std::shared_ptr<PendingPool>& pool, const wire::Request& request,
               LocalChannel& channel) noexcept
      : pool_(&pool), request_(&request), channel_(&channel) {}
  /// Constructs it for a call that waited in its slot for a thread.
  CallDeferral(const std::shared_ptr<PendingPool>& pool, PendingCall& queued) noexcept
      : pool_(&pool), call_(&queued) {}

  DeferredReply defer() noexcept override {
    return take() ? reply_for(*pool_, call_) : DeferredReply{};
  }
  ItemWriter stream() noexcept override {
    const bool is_stream = sessions_ != nullptr ? sessions_->item_size_max(*request_) > 0
                                                : call_ != nullptr && call_->item_size_max > 0;
    lacks_stream_ = !is_stream;
    return is_stream && take() ? writer_for(*pool_, call_) : ItemWriter{};
  }
  [[nodiscard]] bool is_taken() const noexcept { return is_taken_; }
  /// Whether the method gives a stream, and the caller did not ask for one.
  [[nodiscard]] bool lacks_stream() const noexcept { return lacks_stream_; }
  /// The call, if its method has deferred the answer; otherwise null.
  [[nodiscard]] PendingCall* taken() const noexcept { return is_taken_ ? call_ : nullptr; }

 private:
  [[nodiscard]] bool take() noexcept {
    RTPM_ASSERT(!is_taken_, "a call is deferred once");
    if (pool_ == nullptr) return false;
    if (request_ == nullptr) {
      is_taken_ = (*pool_)->keep_deferred(*call_);
      if (is_taken_) call_->reply = call_->reply_room;
      return is_taken_;
    }
    if (channel_ != nullptr) {
      call_ = (*pool_)->take();
      if (call_ != nullptr) {
        call_->take_in(*request_, *channel_, /*is_elsewhere=*/true);
        call_->request.payload = {};
      }
    } else if (call_ == nullptr) {
      call_ = (*pool_)->keep(*sessions_, *request_);
    }
    is_taken_ = call_ != nullptr;
    return is_taken_;
  }

  const std::shared_ptr<PendingPool>* pool_ = nullptr;
  const wire::Request* request_ = nullptr;
  wire::ServerSessions* sessions_ = nullptr;
  LocalChannel* channel_ = nullptr;
  PendingCall* call_ = nullptr;
  bool is_taken_ = false;
  bool lacks_stream_ = false;
};

}  // namespace rtpm::rpc
