#include "calls/pending.hpp"

#include <algorithm>
#include <cstring>
#include <optional>
#include <utility>

#include "rtpm/base/assert.hpp"

namespace rtpm::rpc {
namespace {

constexpr std::size_t kCacheLine = 64;

std::size_t rounded(std::size_t size) noexcept {
  return (size + kCacheLine - 1) / kCacheLine * kCacheLine;
}

}  // namespace

PendingPool::PendingPool(std::uint32_t count, std::uint32_t deferred_count_max,
                         std::uint32_t message_size_max, std::uint32_t stream_byte_max,
                         bool keeps_requests, std::shared_ptr<Doorbell> bell)
    : replies_(count * rounded(std::max(message_size_max, stream_byte_max))),
      requests_(keeps_requests ? count * rounded(message_size_max) : 0),
      calls_(count),
      deferred_count_max_(deferred_count_max),
      bell_(std::move(bell)) {
  const std::size_t room = replies_.bytes().size() / std::max(count, 1U);
  const std::size_t request_room = requests_.bytes().size() / std::max(count, 1U);
  const std::size_t size = std::min<std::size_t>(room, message_size_max);
  free_.reserve(count);
  has_memory_ =
      replies_.bytes().size() == count * rounded(std::max(message_size_max, stream_byte_max)) &&
      requests_.bytes().size() == (keeps_requests ? count * rounded(message_size_max) : 0);
  if (!has_memory_) return;
  for (std::size_t i = calls_.size(); i-- > 0;) {
    free_.push_back(&calls_[i]);
    calls_[i].reply_room = replies_.bytes().subspan(i * room, size);
    if (keeps_requests) {
      calls_[i].request_room = requests_.bytes().subspan(
          i * request_room, std::min<std::size_t>(request_room, message_size_max));
    }
    calls_[i].item_room = replies_.bytes().subspan(i * room, room);
    calls_[i].item_byte_max = std::min(static_cast<std::uint32_t>(room), stream_byte_max);
  }
}

PendingCall* PendingPool::take() noexcept {
  if (free_.empty()) return nullptr;
  PendingCall* const found = free_.back();
  free_.pop_back();
  ++open_count_;
  found->is_taken = true;
  found->ending.store(CallEnding::kNone, std::memory_order_relaxed);
  found->is_awaited.store(true, std::memory_order_relaxed);
  found->is_ended.store(false, std::memory_order_relaxed);
  found->written_count.store(0, std::memory_order_relaxed);
  found->sent_count.store(0, std::memory_order_relaxed);
  found->item_end = 0;
  found->tap_mark = {};
  found->has_refused_large = found->is_blocked = false;
  return found;
}

PendingCall* PendingPool::keep(wire::ServerSessions& sessions,
                               const wire::Request& request) noexcept {
  PendingCall* const call = take();
  if (call == nullptr) return nullptr;
  call->take_in(request, sessions);
  // The payload views a frame or buffer that is reused once the method returns.
  call->request.payload = {};
  sessions.set_tag(request, tag_of(*call));
  return call;
}

void PendingPool::give_back(PendingCall& call) noexcept {
  call.is_taken = false;
  if (std::exchange(call.is_deferred, false)) {
    deferred_count_.fetch_sub(1, std::memory_order_relaxed);
  }
  free_.push_back(&call);
  --open_count_;
}

bool PendingPool::keep_deferred(PendingCall& call) noexcept {
  if (deferred_count_.fetch_add(1, std::memory_order_relaxed) >= deferred_count_max_) {
    deferred_count_.fetch_sub(1, std::memory_order_relaxed);
    return false;
  }
  call.is_deferred = true;
  return true;
}

void PendingPool::notify(PendingCall& call) noexcept {
  if (!call.is_queued.exchange(true, std::memory_order_acq_rel)) ready_.push(call);
  bell_->wake();
}

std::string_view to_string(StreamError error) noexcept {
  switch (error) {
    case StreamError::kFull:
      return "full";
    case StreamError::kEnded:
      return "ended";
    case StreamError::kTooLarge:
      break;
  }
  return "too large";
}

UnfinishedCall& UnfinishedCall::operator=(UnfinishedCall&& other) noexcept {
  std::swap(pool_, other.pool_);
  std::swap(call_, other.call_);
  return *this;
}

UnfinishedCall::~UnfinishedCall() {
  if (call_ != nullptr) end(wire::Status::kServantFailed, 0);
}

bool UnfinishedCall::is_awaited() const noexcept {
  return call_ != nullptr && call_->is_awaited.load(std::memory_order_acquire);
}

CallEnding UnfinishedCall::ending() const noexcept {
  if (call_ == nullptr || is_awaited()) return CallEnding::kNone;
  return call_->ending.load(std::memory_order_relaxed);
}

MonotonicTime UnfinishedCall::deadline() const noexcept {
  return call_ == nullptr ? MonotonicTime{} : call_->request.deadline;
}

void UnfinishedCall::end(wire::Status status, std::uint32_t size) noexcept {
  RTPM_ASSERT(call_ != nullptr, "a call is ended once");
  RTPM_ASSERT(size <= call_->reply.size(), "a reply stays within its buffer");
  // hp-5.10-10: a failure after a too large item is reported as kTooLarge.
  if (status == wire::Status::kServantFailed && call_->has_refused_large) {
    status = wire::Status::kTooLarge;
  }
  call_->status = status;
  call_->size = size;
  call_->is_ended.store(true, std::memory_order_release);
  pool_->notify(*call_);
  call_ = nullptr;
  pool_.reset();
}

MutableBytes DeferredReply::buffer() noexcept {
  return call_ == nullptr ? MutableBytes{} : call_->reply;
}

std::uint32_t ItemWriter::item_size_max() const noexcept {
  return call_ == nullptr ? 0 : call_->item_size_max;
}

std::uint32_t ItemWriter::item_frame_size_max() const noexcept {
  return call_ == nullptr ? 0 : call_->item_frame_size_max;
}

std::uint32_t ItemWriter::waiting_count() const noexcept {
  if (call_ == nullptr) return 0;
  return call_->written_count.load(std::memory_order_relaxed) -
         call_->sent_count.load(std::memory_order_acquire);
}

// The offset for the next item of that size. `is_empty`: no items are queued. nullopt if there is
// no space.
std::optional<std::uint32_t> ItemWriter::place_for(std::uint32_t size, bool is_empty,
                                                   std::uint32_t first_waiting) const noexcept {
  if (is_empty) return 0;
  const std::uint32_t begin = first_waiting;
  const std::uint32_t end = call_->item_end;
  // Each item takes at least one byte, so end == begin means full.
  if (end <= begin) return size <= begin - end ? std::optional(end) : std::nullopt;
  if (end <= call_->item_byte_max && size <= call_->item_byte_max - end) return end;
  return size <= begin ? std::optional(0U) : std::nullopt;
}

expected<void, StreamError> ItemWriter::write(ConstBytes item, std::uint32_t size_max) noexcept {
  if (!is_awaited()) return unexpected{StreamError::kEnded};
  if (item.size() > std::min(size_max, call_->item_size_max)) {
    call_->has_refused_large = true;
    return unexpected{StreamError::kTooLarge};
  }
  const std::uint32_t written = call_->written_count.load(std::memory_order_relaxed);
  // SYNC POINT pending-items: the lane no longer reads an item that it counts as sent, and an item
  // counted as written is complete.
  const std::uint32_t sent = call_->sent_count.load(std::memory_order_acquire);
  if (written - sent >= PendingCall::kItemCountMax) return unexpected{StreamError::kFull};
  const auto size = static_cast<std::uint32_t>(item.size());
  const auto offset = place_for(std::max(size, 1U), written == sent,
                                call_->item_places[sent % PendingCall::kItemCountMax].offset);
  if (!offset) return unexpected{StreamError::kFull};
  if (size > 0) std::memcpy(call_->item_room.data() + *offset, item.data(), size);
  call_->item_places[written % PendingCall::kItemCountMax] = {*offset, size};
  call_->item_end = *offset + std::max(size, 1U);
  call_->written_count.store(written + 1, std::memory_order_release);
  pool_->notify(*call_);
  return {};
}

}  // namespace rtpm::rpc
