#pragma once

#include <utility>

#include "rtpm/rpc/servant.hpp"

namespace rtpm::rpc {

class Lane;

/// The call that the calling thread serves, so that the calls that its method makes inherit the
/// rest of its time.
/// @threads  each its own
/// @realtime alloc-free, no syscall
class CurrentCall {
 public:
  CurrentCall(const CallContext& context, const Lane& lane) noexcept
      : outer_(std::exchange(current_, &context)), outer_lane_(std::exchange(lane_, &lane)) {}
  CurrentCall(const CurrentCall&) = delete;
  CurrentCall& operator=(const CurrentCall&) = delete;
  ~CurrentCall() {
    current_ = outer_;
    lane_ = outer_lane_;
  }

  /// Null outside of methods.
  [[nodiscard]] static const CallContext* get() noexcept { return current_; }
  /// The lane that runs the method.
  [[nodiscard]] static const Lane* lane() noexcept { return lane_; }

 private:
  static inline thread_local const CallContext* current_ = nullptr;
  static inline thread_local const Lane* lane_ = nullptr;
  const CallContext* outer_;
  const Lane* outer_lane_;
};

}  // namespace rtpm::rpc
