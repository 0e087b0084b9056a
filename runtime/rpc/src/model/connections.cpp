#include "model/connections.hpp"

#include <algorithm>
#include <utility>

namespace rtpm::rpc {

Connections::Connections(std::size_t count_max, transport::WaitSet& wait_set)
    : wait_set_(wait_set), slots_(count_max) {
  for (std::vector<Slot*>* list : {&free_, &memory_, &streams_, &leftovers_, &taken_leftovers_})
    list->reserve(count_max);
  for (std::size_t i = count_max; i-- > 0;)
    free_.push_back(&slots_[i]);
}

Slot* Connections::find(SourceTag tag) noexcept {
  if (tag.kind() != kConnectionKind && tag.kind() != kEventKind) return nullptr;
  Slot& slot = slots_[tag.index()];
  return slot.stream && tag_of(slot, tag.kind()) == tag ? &slot : nullptr;
}

Slot* Connections::of_peer(const wire::PeerAddress& peer) noexcept {
  Slot& slot = slots_[peer.port & kIndexMask];
  return slot.stream && slot.peer == peer ? &slot : nullptr;
}

bool Connections::add(std::unique_ptr<transport::Connection>& stream, MonotonicTime now) noexcept {
  Slot& slot = *free_.back();
  const auto index = static_cast<std::uint32_t>(&slot - slots_.data());
  const wire::PeerAddress host = stream->host();
  slot.stream = std::move(stream);
  ++slot.generation;
  slot.peer = {host.high, host.low, slot.generation << kIndexBits | index};
  slot.heard = now;
  slot.is_memory = slot.stream->is_memory();
  slot.user = slot.is_memory ? transport::user_of(slot.stream->descriptor()) : std::nullopt;
  slot.is_from_this_host =
      slot.is_memory || transport::is_from_this_host(slot.stream->descriptor());
  if (!watch(slot)) {
    stream = std::move(slot.stream);
    return false;
  }
  free_.pop_back();
  (slot.is_memory ? memory_ : streams_).push_back(&slot);
  return true;
}

bool Connections::watch(const Slot& slot) noexcept {
  const int descriptor = slot.stream->descriptor();
  if (!wait_set_.add(descriptor, tag_of(slot), transport::Trigger::kLevel)) return false;
  const int event = slot.stream->event();
  if (event < 0 || wait_set_.add(event, tag_of(slot, kEventKind), transport::Trigger::kEdge)) {
    return true;
  }
  wait_set_.remove(descriptor);
  return false;
}

std::unique_ptr<transport::Connection> Connections::remove(Slot& slot) noexcept {
  wait_set_.remove(slot.stream->descriptor());
  if (const int event = slot.stream->event(); event >= 0) wait_set_.remove(event);
  std::vector<Slot*>& list = slot.is_memory ? memory_ : streams_;
  *std::ranges::find(list, &slot) = list.back();
  list.pop_back();
  free_.push_back(&slot);
  return std::move(slot.stream);
}

std::size_t Connections::clear() noexcept {
  const std::size_t ended_count = count();
  while (!memory_.empty())
    remove(*memory_.back()).reset();
  while (!streams_.empty())
    remove(*streams_.back()).reset();
  return ended_count;
}

std::span<Slot* const> Connections::take_leftovers() noexcept {
  std::swap(leftovers_, taken_leftovers_);
  leftovers_.clear();
  for (Slot* const slot : taken_leftovers_)
    slot->has_leftovers = false;
  return taken_leftovers_;
}

Slot* Connections::next_with_frame(std::size_t& left) noexcept {
  for (left = std::min(left, memory_.size()); left > 0; --left) {
    // Downwards, because the last connection takes the slot of one that ends.
    if (next_memory_ == 0 || next_memory_ > memory_.size()) next_memory_ = memory_.size();
    Slot* const slot = memory_[--next_memory_];
    if (!slot->stream->has_buffered()) continue;
    --left;
    return slot;
  }
  return nullptr;
}

bool Connections::announce_sleep() noexcept {
  bool may_sleep = true;
  for (Slot* const slot : memory_) {
    if (!slot->stream->announce_sleep()) may_sleep = false;
  }
  return may_sleep;
}

void Connections::end_sleep() noexcept {
  for (Slot* const slot : memory_)
    slot->stream->end_sleep();
}

}  // namespace rtpm::rpc
