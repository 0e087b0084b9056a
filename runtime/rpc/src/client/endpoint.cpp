#include "client/endpoint.hpp"

#include <algorithm>
#include <mutex>

#include "rtpm/rt/memory.hpp"

namespace rtpm::rpc {
namespace {

// Numbers the channels of the whole program, so that servers can distinguish them.
std::atomic<std::uint64_t> channel_serial{0};

// The channel that this thread used last: probably free, and still in the CPU's cache.
struct Hint {
  const Endpoint* endpoint = nullptr;
  std::size_t index = 0;
};
thread_local Hint last_taken;

}  // namespace

Endpoint::Endpoint(ServerAddress address, const NodeConfig& config, NodeKeys& keys,
                   std::uint64_t client_epoch, std::uint64_t clock_domain)
    : address_(std::move(address)),
      config_(config),
      keys_(keys),
      client_epoch_(client_epoch),
      clock_domain_(clock_domain),
      channels_(std::size_t{config.channel_count_max} * kBandCountMax) {}

expected<CallChannel*, CallError> Endpoint::take(Priority priority) noexcept {
  if (CallChannel* channel = take_existing(priority)) return channel;
  return add(priority);
}

CallChannel* Endpoint::take_existing(Priority priority) noexcept {
  // SYNC POINT endpoint-channels: a counted channel is fully constructed.
  const std::size_t count = channel_count_.load(std::memory_order_acquire);
  if (last_taken.endpoint == this && last_taken.index < count) {
    CallChannel& channel = *channels_[last_taken.index];
    if (channel.serves(priority) && channel.try_take()) return &channel;
  }
  for (std::size_t i = 0; i < count; ++i) {
    CallChannel& channel = *channels_[i];
    if (!channel.serves(priority) || !channel.try_take()) continue;
    last_taken = {this, i};
    return &channel;
  }
  // A channel whose handshake never succeeded belongs to no band yet.
  for (std::size_t i = 0; i < count; ++i) {
    CallChannel& channel = *channels_[i];
    if (channel.is_new() && channel.try_take()) return &channel;
  }
  return nullptr;
}

void Endpoint::check_oneways(MonotonicTime now) noexcept {
  // SYNC POINT endpoint-channels
  const std::size_t count = channel_count_.load(std::memory_order_acquire);
  for (std::size_t i = 0; i < count; ++i) {
    CallChannel& channel = *channels_[i];
    // Other channels are left to callers, which would open another one for each channel taken here.
    if (!channel.has_unconfirmed() || !channel.try_take()) continue;
    channel.check_oneways(now);
    channel.release();
  }
}

bool Endpoint::try_end() noexcept {
  const std::size_t count = channel_count_.load(std::memory_order_acquire);
  for (std::size_t i = 0; i < count; ++i) {
    if (channels_[i]->try_take()) continue;
    while (i > 0)
      channels_[--i]->release();
    return false;
  }
  return true;
}

// The number of channels known to serve the band of `priority`.
std::size_t Endpoint::count_for(Priority priority, std::size_t count) const noexcept {
  return static_cast<std::size_t>(
      std::count_if(channels_.begin(), channels_.begin() + static_cast<std::ptrdiff_t>(count),
                    [&](const auto& c) { return c->serves(priority) || c->is_new(); }));
}

expected<CallChannel*, CallError> Endpoint::add(Priority priority) noexcept {
  const rt::AllowAllocationScope is_allowed;
  const std::lock_guard lock(adding_);
  const std::size_t count = channel_count_.load(std::memory_order_relaxed);
  if (count == channels_.size() || count_for(priority, count) >= config_.channel_count_max) {
    return unexpected{CallError::kNoChannel};
  }
  channels_[count] = std::make_unique<CallChannel>(address_, config_, keys_, client_epoch_,
                                                   ++channel_serial, clock_domain_, lost_oneways_);
  CallChannel* channel = channels_[count].get();
  const bool is_taken = channel->try_take();
  RTPM_ASSERT(is_taken, "no other thread knows a new channel");
  // SYNC POINT endpoint-channels
  channel_count_.store(count + 1, std::memory_order_release);
  return channel;
}

expected<void, CallError> Endpoint::warm_up(std::span<const Priority> priorities,
                                            MonotonicTime deadline, SetupError& transport_error) {
  for (const Priority priority : priorities) {
    auto taken = take(priority);
    if (!taken) return unexpected{taken.error()};
    TakenChannel channel(*taken);
    if (auto ready = channel->make_ready(priority, deadline); !ready) {
      transport_error = channel->transport_error();
      return ready;
    }
  }
  return {};
}

expected<void, CallError> Endpoint::warm_up_all(MonotonicTime deadline,
                                                SetupError& transport_error) {
  for (int next = Priority::kLowest; next <= Priority::kHighest;) {
    auto taken = take(Priority{next});
    if (!taken) return unexpected{taken.error()};
    TakenChannel channel(*taken);
    if (auto ready = channel->make_ready(Priority{next}, deadline); !ready) {
      transport_error = channel->transport_error();
      return ready;
    }
    const wire::Welcome& welcome = channel->welcome();
    if (welcome.band.high >= welcome.ceiling) break;
    next = welcome.band.high.value() + 1;
  }
  return {};
}

}  // namespace rtpm::rpc
