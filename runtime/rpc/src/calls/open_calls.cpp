#include "calls/open_calls.hpp"

#include <algorithm>
#include <cstring>
#include <utility>

#include "rtpm/rt/clock.hpp"
#include "rtpm/wire/sealed.hpp"

namespace rtpm::rpc {

OpenCalls::OpenCalls(std::shared_ptr<PendingPool> pool, std::uint32_t call_count_max, Media& media,
                     LaneReport& report, Doorbell& doorbell, LaneTap& tap)
    : pool_(std::move(pool)), media_(media), report_(report), doorbell_(doorbell), tap_(tap) {
  // One extra: a call that exhausts its turn is appended before its old entry is removed.
  backlog_.reserve(std::size_t{call_count_max} + 1);
}

bool OpenCalls::serve_ready(Lead& lead) noexcept {
  // The most open calls that a new call waits for.
  constexpr int kCallsPerTurn = 32;
  if (!has_any()) return false;
  take_cancelled(lead, CallEnding::kLeft);
  if (waiting_reply_count_ > 0 && rt::now() >= waiting_reply_due_) serve_waiting_replies(lead);
  if (!pool_->has_ready()) return false;
  bool has_some = false;
  for (int i = 0; i < kCallsPerTurn; ++i) {
    PendingCall* const call = pool_->take_ready();
    if (call == nullptr) break;
    has_some = true;
    serve(lead, *call);
  }
  publish(lead);
  return has_some;
}

// Moves an unfinished stream to the end of the backlog.
bool OpenCalls::serve_backlog(Lead& lead) noexcept {
  // A small call that arrives now waits at most as long as sending this takes.
  constexpr std::size_t kItemBytesPerTurn = std::size_t{32} * 1024;
  item_bytes_left_ = kItemBytesPerTurn;
  const std::size_t count = backlog_.size();
  std::size_t served_count = 0;
  for (; served_count < count && item_bytes_left_ > 0; ++served_count) {
    PendingCall& call = *backlog_[served_count];
    call.is_in_backlog = false;
    serve(lead, call);
  }
  backlog_.erase(backlog_.begin(), backlog_.begin() + static_cast<std::ptrdiff_t>(served_count));
  return count > 0;
}

void OpenCalls::on_frame(Lead& lead, std::uint32_t credit_tag) noexcept {
  if (!has_any()) return;
  take_cancelled(lead, CallEnding::kLeft);
  if (waiting_reply_count_ > 0) {
    bool has_freed = false;
    media_.for_each([&](wire::ServerSessions& each) { has_freed |= each.has_freed_buffer(); });
    if (has_freed) serve_waiting_replies(lead);
  }
  if (credit_tag != 0) serve(lead, pool_->tagged(credit_tag));
}

void OpenCalls::take_cancelled(Lead& lead, CallEnding why) noexcept {
  media_.for_each([&](wire::ServerSessions& sessions) {
    while (const std::uint32_t tag = sessions.next_cancelled()) {
      PendingCall& call = pool_->tagged(tag);
      call.ending.store(why, std::memory_order_relaxed);
      call.is_awaited.store(false, std::memory_order_release);
      serve(lead, call);
    }
  });
}

void OpenCalls::serve(Lead& lead, PendingCall& call) noexcept {
  // The notice may arrive after the lane has seen the end and released the slot.
  if (!call.is_taken) return;
  report_.mark(lead);
  const bool is_ended = call.is_ended.load(std::memory_order_acquire);
  // The method may still read its request. If the connection has ended, the call may already be
  // released.
  if (!send_items(lead, call) || !call.is_taken || !is_ended || call.is_running) return;
  MonotonicTime now = rt::now();
  if (call.sessions != nullptr && must_wait_for_buffer(call, now)) return;
  if (call.is_awaited.load(std::memory_order_relaxed))
    report_.on_end(lead, call.request, call.status, now);
  if (call.tap_mark.number != 0) {
    tap_.on_ended(std::exchange(call.tap_mark, {}), call.request, call.status,
                  call.reply.first(call.size));
  }
  if (call.sessions == nullptr) return serve_local(call);
  wire::ServerSessions& sessions = *call.sessions;
  if (call.size > sessions.reply_size_max(call.request)) {
    call.size = 0;
    call.status = wire::Status::kTooLarge;
  }
  const MutableBytes reserved = copy_unlocked(call, now);
  if (!reserved.empty()) now = rt::now();
  const auto peer = sessions.peer_of(call.request);
  const MutableBytes room =
      reserved.empty() ? sessions.reply_buffer(call.request, now) : MutableBytes{};
  // Its caller no longer waited before there was a buffer.
  const bool is_given_up = reserved.empty() && call.size > room.size();
  if (is_given_up) {
    call.size = 0;
    call.status = wire::Status::kCancelled;
  }
  if (reserved.empty() && call.size > 0) std::memcpy(room.data(), call.reply.data(), call.size);
  const wire::Request request = call.request;
  const ConstBytes frame = sessions.complete(request, call.status, call.size, now, reserved);
  pool_->give_back(call);
  if (peer && !is_given_up) send(lead, sessions, *peer, frame);
}

// Copies a large reply without the lock, which other threads may take meanwhile. Returns nothing if
// the reply is small or the lane has one thread. The call may be cancelled meanwhile.
MutableBytes OpenCalls::copy_unlocked(PendingCall& call, MonotonicTime now) noexcept {
  if (lock_ == nullptr) return {};
  const MutableBytes buffer = call.sessions->reserve_reply(call.request, call.size, now);
  if (buffer.empty()) return {};
  call.is_running = true;
  lock_->unlock();
  std::memcpy(buffer.data(), call.reply.data(), call.size);
  lock_->lock();
  call.is_running = false;
  return buffer;
}

// Whether a call that ended with a large reply must wait for a buffer. It ran, so only its reply
// can answer it; it waits as long as its caller does.
bool OpenCalls::must_wait_for_buffer(PendingCall& call, MonotonicTime now) noexcept {
  wire::ServerSessions& sessions = *call.sessions;
  const bool may_wait = call.is_awaited.load(std::memory_order_relaxed) &&
                        call.request.deadline > now &&
                        call.size <= sessions.reply_size_max(call.request);
  const bool waits = may_wait && call.size > sessions.reply_buffer(call.request, now).size();
  const bool has_waited = std::exchange(call.waits_for_room, waits);
  waiting_reply_count_ = waiting_reply_count_ - (has_waited ? 1 : 0) + (waits ? 1 : 0);
  // A stale due time would keep the lane from sleeping.
  if (waiting_reply_count_ == 0) waiting_reply_due_ = kNever;
  if (waits) {
    waiting_reply_due_ =
        std::min({waiting_reply_due_, call.request.deadline, sessions.next_buffer_time(now)});
  }
  return waits;
}

// Sends queued items until credit, connection or turn budget is exhausted. False if some are left.
bool OpenCalls::send_items(Lead& lead, PendingCall& call) noexcept {
  // SYNC POINT pending-items
  const std::uint32_t written = call.written_count.load(std::memory_order_acquire);
  std::uint32_t sent = call.sent_count.load(std::memory_order_relaxed);
  if (sent == written) return true;
  call.is_blocked = false;
  const auto peer = call.sessions->peer_of(call.request);
  Slot* const slot = peer ? media_.slot_of(*call.sessions, *peer) : nullptr;
  while (sent != written && call.is_taken) {
    if (!call.sessions->peer_of(call.request) || !call.is_awaited.load(std::memory_order_relaxed)) {
      sent = written;
    } else if (!send_item_frame(lead, call, sent, slot)) {
      break;
    } else if (call.is_taken && !call.sessions->is_item_midway(call.request)) {
      if (call.tap_mark.number != 0) tap_.on_item(call.tap_mark, call.request, call.item(sent));
      ++sent;
    }
  }
  media_.flush(lead);
  if (!call.is_taken) return true;
  call.sent_count.store(sent, std::memory_order_release);
  return sent == written;
}

// Sends large replies that found no buffer; one may be free now.
void OpenCalls::serve_waiting_replies(Lead& lead) noexcept {
  waiting_reply_due_ = kNever;
  pool_->for_each_open([&](PendingCall& call) {
    if (call.waits_for_room) serve(lead, call);
  });
}

// Sends the next frame of an item; false if it cannot be sent now.
bool OpenCalls::send_item_frame(Lead& lead, PendingCall& call, std::uint32_t number,
                                Slot* slot) noexcept {
  if (item_bytes_left_ == 0) {
    if (!std::exchange(call.is_in_backlog, true)) backlog_.push_back(&call);
    // The sending thread may sleep while another thread ends a call.
    doorbell_.wake();
    return false;
  }
  const ConstBytes item = call.item(number);
  const std::size_t size_max = wire::kHeaderSize +
                               std::min<std::size_t>(item.size(), call.item_frame_size_max) +
                               wire::kSealedTrailerSize;
  if (slot != nullptr && !slot->stream->has_spare_capacity(size_max)) {
    // hp-16.4-2: a slow reader is not a reason to end the connection.
    constexpr Duration kRetryInterval = std::chrono::milliseconds{1};
    call.is_blocked = true;
    if (retry_time_ == kNever) {
      retry_time_ = rt::now() + kRetryInterval;
      doorbell_.wake();
    }
    return false;
  }
  const ConstBytes frame = call.sessions->push_item(call.request, item, rt::now());
  if (frame.empty()) return false;
  item_bytes_left_ -= std::min(item_bytes_left_, frame.size());
  if (slot == nullptr) {
    const auto peer = call.sessions->peer_of(call.request);
    media_.port_of(*peer).send(lead, *call.sessions, *peer, frame, /*has_more=*/true);
  } else if (!media_.send_frame(lead, *slot, frame)) {
    retire(lead, *slot);
  }
  return true;
}

// Retries streams whose connections were full.
void OpenCalls::retry_blocked(Lead& lead, MonotonicTime now) noexcept {
  if (now < retry_time_) return;
  retry_time_ = kNever;
  pool_->for_each_open([&](PendingCall& call) {
    if (call.is_blocked) serve(lead, call);
  });
}

// Ends streams whose callers were silent for too long.
void OpenCalls::on_time(Lead& lead, MonotonicTime now) noexcept {
  media_.for_each([&](wire::ServerSessions& sessions) {
    if (sessions.next_time() > now) return;
    take_cancelled(lead, CallEnding::kLeft);
    const std::uint64_t expired_before = sessions.counters().expired_count;
    sessions.on_time(now);
    report_.on_silent(lead, sessions.counters().expired_count - expired_before);
    take_cancelled(lead, CallEnding::kSilent);
  });
  if (now >= waiting_reply_due_) serve_waiting_replies(lead);
  retry_blocked(lead, now);
}

// hp-4.5-2
void OpenCalls::end(Lead& lead) noexcept {
  pool_->for_each_open([&](PendingCall& call) {
    call.ending.store(CallEnding::kStopping, std::memory_order_relaxed);
    call.is_awaited.store(false, std::memory_order_release);
    if (call.local != nullptr) {
      // A running call uses its caller's memory; its own thread ends it.
      if (!call.is_running) std::exchange(call.local, nullptr)->finish(wire::Status::kStopping, 0);
      return;
    }
    const auto peer = call.sessions->peer_of(call.request);
    const ConstBytes frame =
        call.sessions->complete(call.request, wire::Status::kStopping, 0, rt::now());
    if (peer) send(lead, *call.sessions, *peer, frame);
    // Keeps the slot: the call's handle may still write there.
  });
  media_.for_each([&](wire::ServerSessions& sessions) {
    while (const auto close = sessions.close_next(rt::now())) {
      send(lead, sessions, close->peer, close->frame);
    }
  });
  publish(lead);
}

void OpenCalls::send(Lead& lead, wire::ServerSessions& sessions, const wire::PeerAddress& peer,
                     ConstBytes frame) noexcept {
  if (frame.empty()) return;
  if (&sessions == &media_.datagrams()) {
    return media_.port_of(peer).send(lead, sessions, peer, frame, /*has_more=*/false);
  }
  Slot* const slot = media_.slot_of(sessions, peer);
  if (slot != nullptr && !media_.send(lead, sessions, *slot, frame)) retire(lead, *slot);
}

MonotonicTime OpenCalls::next_time() const noexcept {
  return std::min({media_.next_time(), waiting_reply_due_, retry_time_});
}

void OpenCalls::admit(Lead& lead, std::unique_ptr<transport::Connection> stream) noexcept {
  media_.admit(lead, std::move(stream));
  take_cancelled(lead, CallEnding::kLeft);
  publish(lead);
}

void OpenCalls::retire(Lead& lead, Slot& slot) noexcept {
  media_.retire(lead, slot);
  take_cancelled(lead, CallEnding::kLeft);
}

void OpenCalls::publish(Lead& lead) noexcept {
  report_.publish(lead, [&](ServerCounters& counters, LaneSample& sample) {
    counters.frames = media_.counters();
    sample.open_call_count = pool_->open_count();
    sample.open_connection_count = media_.connections().count();
  });
}

// Completes a local call whose method has ended it.
void OpenCalls::serve_local(PendingCall& call) noexcept {
  LocalChannel* const channel = call.local;
  // Without a channel, the caller was told that the lane stops.
  if (channel != nullptr && channel->is_place()) {
    channel->finish(call.status, 0);
  } else if (channel != nullptr) {
    const bool fits = call.size <= channel->reply().size();
    if (fits && call.size > 0 && call.reply.data() != channel->reply().data()) {
      std::memcpy(channel->reply().data(), call.reply.data(), call.size);
    }
    channel->finish(fits ? call.status : wire::Status::kTooLarge, fits ? call.size : 0);
  }
  pool_->give_back(call);
}

}  // namespace rtpm::rpc
