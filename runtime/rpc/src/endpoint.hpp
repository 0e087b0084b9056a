#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <vector>

#include "call_channel.hpp"
#include "rtpm/rt/pi_mutex.hpp"

namespace rtpm::rpc {

/// One server as a node sees it: its address and the call channels to it, shared by all bindings.
/// Threads: any, several at once.
class Endpoint {
 public:
  /// As many bands as a server of ours has lanes at most.
  static constexpr std::size_t kBandCountMax = 64;

  Endpoint(ServerAddress address, const NodeConfig& config, std::uint64_t client_epoch,
           std::uint64_t clock_domain);

  /// A free channel for `call_count_max` calls at a time that serves `priority` or can be made to;
  /// it is the caller's until it releases it. Opens one more if all are in use.
  /// RT: alloc-free if one is free.   Errors: kNoChannel.
  [[nodiscard]] expected<CallChannel*, CallError> take(Priority priority,
                                                       std::uint16_t call_count_max = 1) noexcept;

  [[nodiscard]] const ServerAddress& address() const noexcept { return address_; }

 private:
  [[nodiscard]] CallChannel* take_existing(Priority priority,
                                           std::uint16_t call_count_max) noexcept;
  [[nodiscard]] std::size_t count_for(Priority priority, std::size_t count) const noexcept;
  [[nodiscard]] expected<CallChannel*, CallError> add(Priority priority,
                                                      std::uint16_t call_count_max) noexcept;

  ServerAddress address_;
  const NodeConfig& config_;
  std::uint64_t client_epoch_;
  std::uint64_t clock_domain_;
  std::vector<std::unique_ptr<CallChannel>> channels_;  ///< Sized once; filled from the front.
  std::atomic<std::size_t> channel_count_{0};
  rt::PiMutex adding_;
};

}  // namespace rtpm::rpc
