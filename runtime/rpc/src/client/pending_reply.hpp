#pragma once

#include "rtpm/rpc/async.hpp"
#include "rtpm/rpc/binding.hpp"

namespace rtpm::rpc {

/// A call that was begun, as its PendingReply sees it.
struct PendingReply::State {
  State() = default;
  State(const State&) = delete;
  State& operator=(const State&) = delete;
  virtual ~State() = default;

  /// Waits for the end, but not beyond `until`; true if the call has ended.
  [[nodiscard]] virtual bool wait(MonotonicTime until) noexcept = 0;
  /// Gives the reply; called once, after wait() gave true.
  [[nodiscard]] virtual expected<ReplyLease, CallError> take() noexcept = 0;
  /// Ends the call if it has not ended.
  virtual void cancel() noexcept = 0;
  /// The caller no longer asks for the reply.
  virtual void drop() noexcept = 0;
};

}  // namespace rtpm::rpc
