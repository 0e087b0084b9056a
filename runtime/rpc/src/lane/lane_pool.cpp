#include <algorithm>
#include <cstring>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include "lane/lane.hpp"
#include "rtpm/base/assert.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/memory.hpp"
#include "rtpm/rt/priority.hpp"
#include "server/lane_table_owner.hpp"
#include "thread_pool/thread_pool.hpp"

// What a lane does that has several threads; see ThreadPool.
namespace rtpm::rpc {
namespace {

// How long a lane that ends waits for methods that still run, before it tells their callers that
// it stops.
constexpr Duration kStopPatience = std::chrono::seconds{1};

// Lets a method that runs on a call's own place go on with it after its return.
class QueuedDeferral final : public Deferral {
 public:
  QueuedDeferral(const std::shared_ptr<PendingPool>& pool, PendingCall& call) noexcept
      : pool_(pool), call_(call) {}

  DeferredReply defer() noexcept override {
    if (!take()) return {};
    return reply_for(pool_, &call_);
  }
  ItemWriter stream() noexcept override {
    if (call_.item_size_max == 0 || !take()) return {};
    return writer_for(pool_, &call_);
  }
  [[nodiscard]] bool is_taken() const noexcept { return is_taken_; }

 private:
  [[nodiscard]] bool take() noexcept {
    RTPM_ASSERT(!is_taken_, "a call is deferred once");
    is_taken_ = pool_->keep_deferred(call_);
    if (is_taken_) call_.reply = call_.reply_room;
    return is_taken_;
  }

  const std::shared_ptr<PendingPool>& pool_;
  PendingCall& call_;
  bool is_taken_ = false;
};

}  // namespace

expected<void, rt::RealtimeError> Lane::start(rt::RealtimeMode realtime, rt::CpuKeeper* keeper) {
  realtime_ = realtime;
  keeper_ = keeper;
  if (config_.wait.strategy == rt::WaitStrategy::kSpin) {
    if (auto possible = rt::check_spinning(thread_config(0)); !possible) return possible;
  }
  const std::uint32_t count = pool_ ? ThreadPool::static_count(config_) : 1;
  for (std::uint32_t i = 0; i < count; ++i) {
    auto thread = pool_ ? start_worker(pool_->workers()[i], i)
                        : rt::Thread::start(thread_config(0), [this] { run(); });
    if (!thread) return unexpected{thread.error()};
    (pool_ ? pool_->workers()[i].thread : thread_) = std::move(*thread);
  }
  return {};
}

rt::ThreadConfig Lane::thread_config(std::uint32_t index) const {
  rt::ThreadConfig thread_config;
  thread_config.name = config_.name;
  if (index > 0) thread_config.name += "/" + std::to_string(index);
  thread_config.priority = config_.priority;
  thread_config.cpus = config_.cpus;
  thread_config.realtime = realtime_;
  thread_config.schedule = config_.schedule;
  return thread_config;
}

expected<rt::Thread, rt::RealtimeError> Lane::start_worker(Worker& worker, std::uint32_t index) {
  worker.is_started = true;
  worker.has_ended.store(false, std::memory_order_relaxed);
  auto thread = rt::Thread::start(thread_config(index), [this, &worker, index] {
    BusyMark::show_at(&slot_.busy_since_ns[index]);
    work(worker);
  });
  worker.is_started = thread.has_value();
  return thread;
}

void Lane::maintain_threads() noexcept {
  if (!pool_) return;
  std::uint32_t index = 0;
  for (Worker& worker : pool_->workers()) {
    const std::uint32_t number = index++;
    if (worker.is_started && worker.has_ended.load(std::memory_order_acquire)) {
      worker.thread.join();
      worker.is_started = false;
    }
    if (worker.is_started || !worker.is_dynamic || !pool_->is_thread_wanted()) continue;
    if (auto thread = start_worker(worker, number)) {
      worker.thread = std::move(*thread);
      return;  // More when it has begun.
    }
    pool_->refuse_thread();
  }
}

void Lane::join() noexcept {
  thread_.join();
  if (!pool_) return;
  for (Worker& worker : pool_->workers())
    worker.thread.join();
}

// What each thread of a thread pool does, from its begin to its end.
void Lane::work(Worker& me) noexcept {
  const rt::NoAllocationScope no_allocation;
  pool_->lock_as_follower();
  pool_->sign_on(me);
  while (!pool_->is_over()) {
    if (PendingCall* const call = pool_->take_to_run()) {
      run_queued(*call);
    } else if (pool_->take_lead()) {
      rt::adopt_priority(config_.priority);
      lead();
      pool_->leave_lead();
    } else if (Lane* const asked = next_borrower()) {
      help(*asked, nullptr);
    } else if (!pool_->rest(me, config_.dynamic_idle)) {
      break;
    } else if (Lane* const borrower = std::exchange(me.borrower, nullptr)) {
      help(*borrower, me.lent_call);
    }
  }
  pool_->sign_off(me);
  pool_->unlock();
  // So that it is joined.
  if (me.is_dynamic) acceptor_bell_->ring();
}

// Receives until there is a call to run, or the lane is over. With the lock, but while it waits.
void Lane::lead() noexcept {
  MonotonicTime spin_end = kNever;
  while (!is_stopping_.load(std::memory_order_acquire)) {
    step(spin_end);
    if (pool_->has_stuck_call()) find_help();
    if (pool_->has_call_to_run()) return;
    pool_->yield_lock();
  }
  end_pool();
}

// All threads run calls: others may be had from elsewhere.
void Lane::find_help() noexcept {
  if (pool_->ask_for_thread(rt::now())) acceptor_bell_->ring();
  while (pool_->has_stuck_call() && borrow() == BorrowedThread::kGiven) {
  }
}

// Has a thread of a lower lane run the most urgent call that waits.
BorrowedThread Lane::borrow() noexcept {
  const BorrowRequest request{*this, number_, pool_->first(), pool_->queued_count()};
  BorrowedThread best = BorrowedThread::kNone;
  for (Lane* lane = lower_; lane != nullptr && best != BorrowedThread::kGiven;
       lane = lane->lower_) {
    const BorrowedThread borrowed = lane->pool_->lend(request);
    if (borrowed != BorrowedThread::kNone) best = borrowed;
  }
  if (best == BorrowedThread::kGiven) {
    static_cast<void>(pool_->take_any());
    pool_->begin_borrowed_run();
  }
  return best;
}

// The most urgent lane above that asked for a thread when there was none; or null.
Lane* Lane::next_borrower() noexcept {
  const auto number = pool_->take_borrower();
  if (!number) return nullptr;
  Lane* lane = upper_;
  while (lane->number_ != *number)
    lane = lane->upper_;
  return lane;
}

// Has the calling thread run calls of a lane above: `call`, or what needs a thread there.
void Lane::help(Lane& borrower, PendingCall* call) noexcept {
  // Calls of this lane may wait for a thread that finds nothing to do.
  if (call == nullptr) pool_->expect_back();
  pool_->unlock();
  borrower.run_borrowed(call, *pool_);
  rt::adopt_priority(config_.priority);
  pool_->lock_as_follower();
  pool_->end_expecting();
}

// On a thread of a lower lane: runs `call`, unless it is null, and all that are stuck. The lender
// expects its thread back from the end of each call on.
void Lane::run_borrowed(PendingCall* call, ThreadPool& lender) noexcept {
  pool_->lock_as_follower();
  while (call != nullptr || (!pool_->is_over() && pool_->has_stuck_call())) {
    if (call == nullptr) {
      lender.end_expecting();
      call = pool_->take_any();
      pool_->begin_borrowed_run();
    }
    ++counters_.borrowed_count;
    run_queued(*call, &lender);
    call = nullptr;
  }
  pool_->unlock();
}

// Runs a call without the lock, and ends it with the lock. `lender`: whose thread does so.
void Lane::run_queued(PendingCall& call, ThreadPool* lender) noexcept {
  pool_->unlock();
  QueuedDeferral deferral(pending_, call);
  std::optional<DispatchResult> result;
  bool has_thrown = false;
  const bool is_in_time = rt::now() < call.request.deadline;
  if (!call.is_awaited.load(std::memory_order_acquire)) {
    result = DispatchResult{wire::Status::kCancelled, 0};
  } else if (!is_in_time) {
    result = DispatchResult{wire::Status::kExpired, 0};
  } else {
    result = run_servant(*call.object, call.request, call.reply, deferral, has_thrown);
  }
  pool_->lock_as_follower();
  pool_->end_run();
  counters_.servant_failure_count += has_thrown ? 1 : 0;
  counters_.bad_request_count += result->status == wire::Status::kBadRequest ? 1U : 0U;
  call.is_running = false;
  if (deferral.is_taken()) {
    ++counters_.deferred_count;
  } else {
    RTPM_ASSERT(result->reply_size <= call.reply.size(), "a reply stays within its buffer");
    call.status = result->status;
    call.size = result->reply_size;
    call.is_ended.store(true, std::memory_order_release);
  }
  const MonotonicTime now = rt::now();
  const std::int64_t cycle_ns = (now - call.request.received).count();
  sample_.longest_cycle_ns = std::max(sample_.longest_cycle_ns, cycle_ns);
  is_unpublished_ = true;
  // Who is answered may call at once, where this thread is at home.
  if (lender != nullptr) lender->expect_back();
  serve_pending_call(call);
  publish();
  nap_if_overdue(now);
}

// Keeps a call until a thread has time for it, or refuses it.
ConstBytes Lane::queue_request(wire::ServerSessions& sessions, const wire::Request& request,
                               const Object& object) noexcept {
  PendingCall* const call = take_pending();
  if (call == nullptr || !take_in(*call, sessions, request, object)) {
    const wire::Status refusal = refuse();
    if (!request.wants_receipt()) return sessions.complete(request, refusal, 0, request.received);
    const ConstBytes frame = sessions.accept(request, refusal, request.received);
    static_cast<void>(sessions.complete(request, refusal, 0, request.received));
    return frame;
  }
  note_queued(request);
  if (!request.wants_receipt()) return {};
  return sessions.accept(request, wire::Status::kOk, request.received);
}

// A call to keep; null if there are too many, or the lane stops.
PendingCall* Lane::take_pending() noexcept {
  return is_stopping_.load(std::memory_order_relaxed) ? nullptr : pending_->take();
}

// Counts a call that is not kept, and says why.
wire::Status Lane::refuse() noexcept {
  ++counters_.overload_count;
  return is_stopping_.load(std::memory_order_relaxed) ? wire::Status::kStopping
                                                      : wire::Status::kOverload;
}

void Lane::note_queued(const wire::Request& request) noexcept {
  ++counters_.call_count;
  counters_.queued_count_max =
      std::max<std::uint64_t>(counters_.queued_count_max, pool_->queued_count());
  if (is_periodic_) predictor_.on_arrival(request.header.session, request.received);
}

// Copies a request that came over a wire; false if there is no place for it.
bool Lane::take_in(PendingCall& call, wire::ServerSessions& sessions, const wire::Request& request,
                   const Object& object) noexcept {
  const std::size_t size = request.payload.size();
  call.take_in(request, sessions);
  call.request.payload = ConstBytes(call.request_room).first(size);
  if (size > 0) std::memcpy(call.request_room.data(), request.payload.data(), size);
  if (!find_place(call, object)) return false;
  sessions.set_tag(request, pending_->tag_of(call));
  return true;
}

// Puts a call among those that wait, unless there is neither place nor help; then gives it back.
bool Lane::find_place(PendingCall& call, const Object& object) noexcept {
  const std::size_t size = call.request.payload.size();
  const bool has_place = pool_->has_place_for(size);
  call.object = &object;
  call.is_running = true;
  pool_->enqueue(call, priority_of(object, call.request.header), size);
  if (has_place || borrow() != BorrowedThread::kNone) return true;
  pool_->withdraw(call);
  pending_->give_back(call);
  return false;
}

// The end of the lane: what waits is told so, what runs has some time.
void Lane::end_pool() noexcept {
  gate_->close();
  while (PendingCall* const call = pool_->take_any()) {
    call->is_running = false;
    call->status = wire::Status::kStopping;
    call->size = 0;
    call->is_ended.store(true, std::memory_order_release);
    serve_pending_call(*call);
  }
  const MonotonicTime end = rt::now() + kStopPatience;
  while (pool_->running_count() > 0 && rt::now() < end) {
    static_cast<void>(turn());
    static_cast<void>(look_around(std::min(end, rt::now() + std::chrono::milliseconds{1})));
    pool_->yield_lock();
  }
  say_goodbye();
  pool_->end();
}

}  // namespace rtpm::rpc
