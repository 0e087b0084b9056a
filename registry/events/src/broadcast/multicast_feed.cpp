#include "broadcast/multicast_feed.hpp"

#include <utility>

namespace rtpm::events {
namespace {

// Datagrams received per locking.
constexpr int kDatagramsPerTurn = 64;

}  // namespace

std::shared_ptr<MulticastFeed> MulticastFeed::open(const transport::MulticastGroup& group) {
  auto receiver = transport::MulticastReceiver::open(group);
  auto wait_set = transport::WaitSet::open(1);
  auto bell = transport::BroadcastBell::make();
  if (!receiver || !wait_set || !bell) return nullptr;
  const transport::SourceTag socket{transport::SourceKind{1}};
  if (!(*wait_set)->add(receiver->descriptor(), socket, transport::Trigger::kLevel)) return nullptr;
  return std::shared_ptr<MulticastFeed>(
      new MulticastFeed(std::move(*receiver), std::move(*wait_set), std::move(bell->first)));
}

void MulticastFeed::fetch(std::uint32_t seen, std::uint32_t) noexcept {
  const std::lock_guard lock(fetching_);
  if (is_stopped_.load(std::memory_order_acquire) || value() != seen) return;
  std::array<transport::SourceTag, 2> ready{};
  static_cast<void>(wait_set_->wait(kNever, ready));
  // SYNC POINT bell: data is written before the doorbell rings.
  if (take_in()) bell_.ring(~0U);
}

bool MulticastFeed::take_in() noexcept {
  const std::lock_guard lock(mutex_);
  const std::uint64_t begin = end();
  std::uint64_t next = begin;
  for (int i = 0; i < kDatagramsPerTurn; ++i) {
    Slot& slot = slots_[next % kHistoryCount];
    slot.size = receiver_.receive(slot.bytes).size();
    if (slot.size == 0) break;
    ++next;
  }
  end_.store(next, std::memory_order_release);
  return next != begin;
}

void MulticastFeed::stop() noexcept {
  is_stopped_.store(true, std::memory_order_release);
  bell_.ring(~0U);
  wait_set_->ring();
}

}  // namespace rtpm::events
