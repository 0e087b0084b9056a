#pragma once

#include <utility>

#include "rtpm/rpc/servant.hpp"

namespace rtpm::rpc {

/// The call that the calling thread serves, so that the calls that its method makes inherit what is
/// left of its time.
/// Threads: each its own.   RT: alloc-free, no syscall.
class CurrentCall {
 public:
  explicit CurrentCall(const CallContext& context) noexcept
      : outer_(std::exchange(current_, &context)) {}
  CurrentCall(const CurrentCall&) = delete;
  CurrentCall& operator=(const CurrentCall&) = delete;
  ~CurrentCall() { current_ = outer_; }

  /// Null outside of methods.
  [[nodiscard]] static const CallContext* get() noexcept { return current_; }

 private:
  static inline thread_local const CallContext* current_ = nullptr;
  const CallContext* outer_;
};

}  // namespace rtpm::rpc
