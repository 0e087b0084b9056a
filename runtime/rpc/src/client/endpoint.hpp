#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "client/call_channel.hpp"
#include "rtpm/rt/pi_mutex.hpp"

namespace rtpm::rpc {

/// Releases the channel unless a reply lease takes it over.
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

/// A server's address, and a node's call channels to it, shared by all bindings.
/// @threads  any, concurrently
/// @realtime alloc-free, except take() if no channel is free, and try_end()
class Endpoint {
 public:
  /// The most bands: an RTPM server has no more lanes.
  static constexpr std::size_t kBandCountMax = 64;

  Endpoint(ServerAddress address, const NodeConfig& config, NodeKeys& keys,
           std::uint64_t client_epoch, std::uint64_t clock_domain);

  /// Takes a free channel that serves, or can serve, `priority`, until the caller releases it.
  /// Opens another one if all are in use.
  /// @errors   kNoChannel
  [[nodiscard]] expected<CallChannel*, CallError> take(Priority priority) noexcept;

  /// Opens a channel for the band of each of `priorities`.
  /// @param transport_error  see CallChannel::transport_error()
  [[nodiscard]] expected<void, CallError> warm_up(std::span<const Priority> priorities,
                                                  MonotonicTime deadline,
                                                  SetupError& transport_error);
  /// Opens a channel for each of the server's bands.
  [[nodiscard]] expected<void, CallError> warm_up_all(MonotonicTime deadline,
                                                      SetupError& transport_error);

  /// Checks the free channels for sessions that ended before oneways were confirmed.
  void check_oneways(MonotonicTime now) noexcept;
  /// Oneways that were sent over the channels but may not have arrived because their sessions
  /// ended.
  [[nodiscard]] std::uint64_t lost_oneway_count() const noexcept {
    // SYNC POINT lost-oneways: the channels of the counted oneways have ended.
    return lost_oneways_.load(std::memory_order_acquire);
  }
  // The number of bindings that use it; changed by the node only. Any thread may ask.
  [[nodiscard]] std::size_t user_count() const noexcept {
    return user_count_.load(std::memory_order_relaxed);
  }
  void add_user() noexcept { user_count_.fetch_add(1, std::memory_order_relaxed); }
  void remove_user() noexcept { user_count_.fetch_sub(1, std::memory_order_relaxed); }
  /// Takes every channel, so that the endpoint can be destroyed. False if a call or a reply still
  /// holds one. No thread may take channels meanwhile.
  [[nodiscard]] bool try_end() noexcept;

  [[nodiscard]] const ServerAddress& address() const noexcept { return address_; }

 private:
  [[nodiscard]] CallChannel* take_existing(Priority priority) noexcept;
  [[nodiscard]] std::size_t count_for(Priority priority, std::size_t count) const noexcept;
  [[nodiscard]] expected<CallChannel*, CallError> add(Priority priority) noexcept;

  ServerAddress address_;
  const NodeConfig& config_;
  NodeKeys& keys_;
  std::uint64_t client_epoch_;
  std::uint64_t clock_domain_;
  std::atomic<std::uint64_t> lost_oneways_{0};
  /// Has a fixed size; filled from the front.
  std::vector<std::unique_ptr<CallChannel>> channels_;
  std::atomic<std::size_t> channel_count_{0};
  std::atomic<std::size_t> user_count_{0};
  rt::PiMutex adding_;
};

}  // namespace rtpm::rpc
