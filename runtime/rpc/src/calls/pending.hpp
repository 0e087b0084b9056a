#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "local/local.hpp"
#include "local/ready_list.hpp"
#include "rtpm/base/bytes.hpp"
#include "rtpm/rpc/deferred.hpp"
#include "rtpm/rt/lazy_memory.hpp"
#include "rtpm/wire/server_sessions.hpp"
#include "security/call_origin.hpp"
#include "tap/lane_tap.hpp"

namespace rtpm::rpc {

struct Object;

/// A call that its method has not ended yet. The method's thread writes, one at a time; the lane
/// reads.
struct PendingCall {
  static constexpr std::uint32_t kItemCountMax = wire::kStreamWindow;

  // Guarded by the Lead.
  wire::Request request{};
  bool is_taken = false;
  wire::ServerSessions* sessions = nullptr;  ///< Null for a local call.
  LocalChannel* local = nullptr;
  std::uint32_t item_size_max = 0;        ///< 0 if the call is not a stream.
  std::uint32_t item_frame_size_max = 0;  ///< The largest item of a single frame.
  bool is_blocked = false;                ///< Its connection cannot take items now.
  bool is_in_backlog = false;             ///< See OpenCalls::serve_backlog().
  // The members below are used by a lane with a thread pool.
  const Object* object = nullptr;
  std::optional<CallOrigin> origin{};  ///< Set once a call of a secured server was queued.
  MutableBytes request_room{};
  bool is_running = false;  ///< It runs or waits for a thread, so it must not be ended yet.
  /// The call ended with a large reply, for which there was no buffer yet.
  bool waits_for_room = false;
  bool is_deferred = false;  ///< Counts as deferred. Written by the method's thread while it runs.
  TapMark tap_mark{};        ///< Written by the method's thread, then under the Lead.

  /// Fills the slot for a call over a transport; does not copy the request's payload.
  void take_in(const wire::Request& its_request, wire::ServerSessions& its_sessions) noexcept {
    request = its_request;
    sessions = &its_sessions;
    local = nullptr;
    reply = reply_room;
    const auto room = static_cast<std::uint32_t>(item_room.size());
    item_size_max = std::min(room, its_sessions.item_size_max(request));
    item_frame_size_max = std::min(room, its_sessions.item_frame_size_max(request));
  }
  /// A written item.
  [[nodiscard]] ConstBytes item(std::uint32_t number) const noexcept {
    const ItemPlace& place = item_places[number % kItemCountMax];
    return ConstBytes(item_room).subspan(place.offset, place.size);
  }
  /// Fills the slot for a call within this program. The reply goes to the caller's memory, unless
  /// `is_elsewhere`: a later reply may find its caller gone.
  void take_in(const wire::Request& its_request, LocalChannel& channel,
               bool is_elsewhere) noexcept {
    request = its_request;
    sessions = nullptr;
    local = &channel;
    reply = is_elsewhere ? reply_room : channel.reply();
    item_size_max = item_frame_size_max = 0;
  }

  // Shared between the method's thread and the lane.
  std::atomic<PendingCall*> next_ready{nullptr};
  std::atomic<bool> is_queued{false};
  /// Why the caller no longer waits; written before is_awaited.
  std::atomic<CallEnding> ending{CallEnding::kNone};
  std::atomic<bool> is_awaited{false};
  std::atomic<bool> is_ended{false};
  wire::Status status = wire::Status::kOk;  ///< Valid if is_ended.
  std::uint32_t size = 0;
  MutableBytes reply{};
  MutableBytes reply_room{};
  /// The items of a stream, a ring of `item_byte_max` bytes; a larger item is stored alone. Shares
  /// its memory with reply_room, as the reply of a stream has no content.
  MutableBytes item_room{};
  std::uint32_t item_byte_max = 0;
  struct ItemPlace {
    std::uint32_t offset = 0;
    std::uint32_t size = 0;
  };
  std::array<ItemPlace, kItemCountMax> item_places{};
  std::uint32_t item_end = 0;      ///< The end of the last written item; used by the writer only.
  bool has_refused_large = false;  ///< An item was too large; used by the writer only.
  std::atomic<std::uint32_t> written_count{0};
  std::atomic<std::uint32_t> sent_count{0};
};

/// The unfinished calls of one lane, a bounded number, and the list of those with items or a reply
/// to send. Handles of unfinished calls may keep it alive after its lane.
/// @threads  notify() and keep_deferred(): any; the rest: the lane's
/// @realtime alloc-free except construction
class PendingPool {
 public:
  /// `deferred_count_max`: how many of the `count` slots may outlast their methods.
  /// `stream_byte_max`: how many bytes of items each stream may hold. `keeps_requests`: each slot
  /// also has memory for the request.
  PendingPool(std::uint32_t count, std::uint32_t deferred_count_max, std::uint32_t message_size_max,
              std::uint32_t stream_byte_max, bool keeps_requests, std::shared_ptr<Doorbell> bell);

  /// False if the system gave too little memory; then there are no slots.
  [[nodiscard]] bool has_memory() const noexcept { return has_memory_; }

  /// Returns a free slot, or null.
  [[nodiscard]] PendingCall* take() noexcept;
  /// Returns a free slot, or null, for a call over a transport that may outlast its frame.
  [[nodiscard]] PendingCall* keep(wire::ServerSessions& sessions,
                                  const wire::Request& request) noexcept;
  void give_back(PendingCall& call) noexcept;
  /// Lets a call that waited in its slot outlast its method; false if too many calls do.
  /// @threads  any
  [[nodiscard]] bool keep_deferred(PendingCall& call) noexcept;
  [[nodiscard]] std::uint32_t tag_of(const PendingCall& call) const noexcept {
    return static_cast<std::uint32_t>(&call - calls_.data()) + 1;
  }
  [[nodiscard]] PendingCall& tagged(std::uint32_t tag) noexcept { return calls_[tag - 1]; }
  [[nodiscard]] std::uint32_t open_count() const noexcept { return open_count_; }
  /// Visits every slot in use.
  template <class Visitor>
  void for_each_open(Visitor visit) noexcept {
    for (PendingCall& call : calls_) {
      if (call.is_taken) visit(call);
    }
  }

  /// Wakes the lane: the call has items, or has ended.
  void notify(PendingCall& call) noexcept;
  [[nodiscard]] bool has_ready() const noexcept { return !ready_.is_empty(); }
  [[nodiscard]] bool may_sleep() const noexcept { return ready_.is_empty_before_sleep(); }
  /// Returns the call that was notified first, or null.
  [[nodiscard]] PendingCall* take_ready() noexcept {
    PendingCall* const call = ready_.take_next();
    if (call != nullptr) call->is_queued.exchange(false, std::memory_order_acq_rel);
    return call;
  }

 private:
  bool has_memory_ = false;
  rt::LazyMemory replies_;
  rt::LazyMemory requests_;
  std::vector<PendingCall> calls_;
  std::vector<PendingCall*> free_;  ///< The last used slot is last. Has a fixed capacity.
  std::uint32_t open_count_ = 0;
  std::uint32_t deferred_count_max_;
  std::atomic<std::uint32_t> deferred_count_{0};
  ReadyList<PendingCall> ready_;
  std::shared_ptr<Doorbell> bell_;
};

}  // namespace rtpm::rpc
