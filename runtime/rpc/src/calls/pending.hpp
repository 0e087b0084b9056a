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

/// A call that its method has not ended. The method's thread writes, one at a time; the lane reads.
struct PendingCall {
  static constexpr std::uint32_t kItemCountMax = wire::kStreamWindow;

  // Under the Lead.
  wire::Request request{};
  bool is_taken = false;
  wire::ServerSessions* sessions = nullptr;  ///< Null if `local` has the call.
  LocalChannel* local = nullptr;
  std::uint32_t item_size_max = 0;        ///< 0 if it is not a stream.
  std::uint32_t item_frame_size_max = 0;  ///< The largest item of a single frame.
  bool is_blocked = false;                ///< Its connection has no room for items now.
  bool is_in_backlog = false;             ///< See OpenCalls::serve_backlog().
  // The members below are used in a lane with a thread pool.
  const Object* object = nullptr;
  std::optional<CallOrigin> origin{};  ///< Set in a secured server once the call was queued.
  MutableBytes request_room{};
  bool is_running = false;      ///< It runs or waits for a thread: do not end it yet.
  bool waits_for_room = false;  ///< It ended with a large reply for which there was no room yet.
  bool is_deferred = false;  ///< Counts as deferred. The method's thread writes it while it runs.
  TapMark tap_mark{};        ///< Written by the method's thread, then under the Lead.

  /// A call that came over a wire; the request's payload stays where it is.
  void take_in(const wire::Request& its_request, wire::ServerSessions& its_sessions) noexcept {
    request = its_request;
    sessions = &its_sessions;
    local = nullptr;
    reply = reply_room;
    const auto room = static_cast<std::uint32_t>(item_room.size());
    item_size_max = std::min(room, its_sessions.item_size_max(request));
    item_frame_size_max = std::min(room, its_sessions.item_frame_size_max(request));
  }
  /// An item that was written.
  [[nodiscard]] ConstBytes item(std::uint32_t number) const noexcept {
    const ItemPlace& place = item_places[number % kItemCountMax];
    return ConstBytes(item_room).subspan(place.offset, place.size);
  }
  /// A call of the same program. It is answered where its caller wants the reply, unless that has
  /// to be `is_elsewhere`: a reply that comes later may find its caller gone.
  void take_in(const wire::Request& its_request, LocalChannel& channel,
               bool is_elsewhere) noexcept {
    request = its_request;
    sessions = nullptr;
    local = &channel;
    reply = is_elsewhere ? reply_room : channel.reply();
    item_size_max = item_frame_size_max = 0;
  }

  // Shared.
  std::atomic<PendingCall*> next_ready{nullptr};
  std::atomic<bool> is_queued{false};
  /// Why its caller does not wait; written before is_awaited.
  std::atomic<CallEnding> ending{CallEnding::kNone};
  std::atomic<bool> is_awaited{false};
  std::atomic<bool> is_ended{false};
  wire::Status status = wire::Status::kOk;  ///< Valid if is_ended.
  std::uint32_t size = 0;
  MutableBytes reply{};
  MutableBytes reply_room{};
  /// The items of a stream, written one behind the other, from the beginning again at
  /// `item_byte_max`; a larger one has it alone. The same memory as reply_room: the reply of a
  /// stream has no content.
  MutableBytes item_room{};
  std::uint32_t item_byte_max = 0;
  struct ItemPlace {
    std::uint32_t offset = 0;
    std::uint32_t size = 0;
  };
  std::array<ItemPlace, kItemCountMax> item_places{};
  std::uint32_t item_end = 0;      ///< Behind the last that was written; the writer's own.
  bool has_refused_large = false;  ///< An item was too large; the writer's own.
  std::atomic<std::uint32_t> written_count{0};
  std::atomic<std::uint32_t> sent_count{0};
};

/// The unfinished calls of one lane, a bounded number, and the list of those with items or an end
/// for the lane to send. Handles of unfinished calls keep it alive beyond the lane's own end.
/// @threads  notify() and keep_deferred() any; everything else the lane's
/// @realtime alloc-free but for construction
class PendingPool {
 public:
  /// `deferred_count_max`: how many of the `count` may be those of methods that have returned.
  /// `stream_byte_max`: how many bytes of items each stream may hold. `keeps_requests`: each place
  /// has room for the request, too.
  PendingPool(std::uint32_t count, std::uint32_t deferred_count_max, std::uint32_t message_size_max,
              std::uint32_t stream_byte_max, bool keeps_requests, std::shared_ptr<Doorbell> bell);

  /// Whether the system gave its memory; if not, there are no places, or some lack items.
  [[nodiscard]] bool has_memory() const noexcept { return has_memory_; }

  /// A free place, or null.
  [[nodiscard]] PendingCall* take() noexcept;
  /// A free place, or null, for a call that came over a wire and may outlast its frame.
  [[nodiscard]] PendingCall* keep(wire::ServerSessions& sessions,
                                  const wire::Request& request) noexcept;
  void give_back(PendingCall& call) noexcept;
  /// Lets a call that waited in its place outlast its method; false if too many do.
  /// @threads  any
  [[nodiscard]] bool keep_deferred(PendingCall& call) noexcept;
  [[nodiscard]] std::uint32_t tag_of(const PendingCall& call) const noexcept {
    return static_cast<std::uint32_t>(&call - calls_.data()) + 1;
  }
  [[nodiscard]] PendingCall& tagged(std::uint32_t tag) noexcept { return calls_[tag - 1]; }
  [[nodiscard]] std::uint32_t open_count() const noexcept { return open_count_; }
  /// Every call that is not free.
  template <class Visitor>
  void for_each_open(Visitor visit) noexcept {
    for (PendingCall& call : calls_) {
      if (call.is_taken) visit(call);
    }
  }

  /// The call has items, or has ended: wakes the lane.
  void notify(PendingCall& call) noexcept;
  [[nodiscard]] bool has_ready() const noexcept { return !ready_.is_empty(); }
  [[nodiscard]] bool may_sleep() const noexcept { return ready_.is_empty_before_sleep(); }
  /// The call that was notified first, or null.
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
  std::vector<PendingCall*> free_;  ///< The last was used last. Sized once.
  std::uint32_t open_count_ = 0;
  std::uint32_t deferred_count_max_;
  std::atomic<std::uint32_t> deferred_count_{0};
  ReadyList<PendingCall> ready_;
  std::shared_ptr<Doorbell> bell_;
};

}  // namespace rtpm::rpc
