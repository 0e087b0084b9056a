#pragma once

#include <utility>

#include "rtpm/rpc/servant.hpp"

namespace rtpm::rpc {

class LocalHost;

/// The call that the calling thread serves, so that nested calls inherit its remaining time.
/// @threads  each sees its own
/// @realtime alloc-free, no syscall
class CurrentCall {
 public:
  CurrentCall(const CallContext& context, const LocalHost& host) noexcept
      : outer_(std::exchange(current_, &context)), outer_host_(std::exchange(host_, &host)) {}
  CurrentCall(const CurrentCall&) = delete;
  CurrentCall& operator=(const CurrentCall&) = delete;
  ~CurrentCall() {
    current_ = outer_;
    host_ = outer_host_;
  }

  /// Null outside methods.
  [[nodiscard]] static const CallContext* get() noexcept { return current_; }
  /// The lane that runs the method.
  [[nodiscard]] static const LocalHost* host() noexcept { return host_; }

 private:
  static inline thread_local const CallContext* current_ = nullptr;
  static inline thread_local const LocalHost* host_ = nullptr;
  const CallContext* outer_;
  const LocalHost* outer_host_;
};

}  // namespace rtpm::rpc
