#include "execution/pooled_execution.hpp"

#include <algorithm>
#include <cstring>
#include <utility>

#include "calls/deferral.hpp"
#include "execution/throttling.hpp"
#include "model/lane_table_owner.hpp"
#include "rtpm/base/assert.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/memory.hpp"
#include "rtpm/rt/priority.hpp"

namespace rtpm::rpc {
namespace {

// Answers a request that will not run.
ConstBytes answer(wire::ServerSessions& sessions, const wire::Request& request,
                  wire::Status status) noexcept {
  if (!request.wants_receipt()) return sessions.complete(request, status, 0, request.received);
  const ConstBytes frame = sessions.accept(request, status, request.received);
  static_cast<void>(sessions.complete(request, status, 0, request.received));
  return frame;
}

}  // namespace

PooledExecution::PooledExecution(const LaneParts& parts, std::uint32_t number,
                                 PooledExecution* lower, std::uint32_t call_count_max,
                                 transport::WaitSet& acceptor)
    : Execution(parts),
      number_(number),
      lower_(lower),
      acceptor_(acceptor),
      pool_(parts.config, call_count_max, parts.wait_set) {
  if (lower != nullptr) lower->upper_ = this;
}

expected<void, SetupError> PooledExecution::start_threads() {
  for (std::uint32_t i = 0; i < ThreadPool::static_count(parts_.config); ++i) {
    auto thread = start_worker(pool_.workers()[i], i);
    if (!thread) return unexpected{thread.error()};
    pool_.workers()[i].thread = std::move(*thread);
  }
  return {};
}

expected<rt::Thread, SetupError> PooledExecution::start_worker(Worker& worker,
                                                               std::uint32_t index) {
  worker.is_started = true;
  worker.has_ended.store(false, std::memory_order_relaxed);
  auto thread = rt::Thread::start(thread_config(index), [this, &worker, index] {
    BusyMark::show_at(&parts_.slot.busy_since_ns[index]);
    work(worker);
  });
  worker.is_started = thread.has_value();
  return thread;
}

void PooledExecution::maintain_threads() noexcept {
  std::uint32_t index = 0;
  for (Worker& worker : pool_.workers()) {
    const std::uint32_t number = index++;
    if (worker.is_started && worker.has_ended.load(std::memory_order_acquire)) {
      worker.thread.join();
      worker.is_started = false;
    }
    if (worker.is_started || !worker.is_dynamic || !pool_.is_thread_wanted()) continue;
    if (auto thread = start_worker(worker, number)) {
      worker.thread = std::move(*thread);
      return;  // Starts more once this one runs.
    }
    pool_.refuse_thread();
  }
}

void PooledExecution::join() noexcept {
  for (Worker& worker : pool_.workers())
    worker.thread.join();
}

// Each thread's main function.
void PooledExecution::work(Worker& me) noexcept {
  const rt::NoAllocationScope no_allocation;
  Lead& lead = pool_.lock_as_follower();
  pool_.sign_on(me);
  while (!pool_.is_over()) {
    if (PendingCall* const call = pool_.take_to_run()) {
      run(*call, nullptr);
    } else if (pool_.take_lead()) {
      rt::adopt_priority(parts_.config.priority);
      parts_.cycle.serve(lead);
      pool_.leave_lead();
    } else if (PooledExecution* const asked = next_borrower()) {
      help(*asked, nullptr);
    } else if (!pool_.rest(me, parts_.config.dynamic_idle)) {
      break;
    } else if (PooledExecution* const borrower = std::exchange(me.borrower, nullptr)) {
      help(*borrower, me.lent_call);
    }
  }
  pool_.sign_off(me);
  pool_.unlock();
  // The acceptor joins it.
  if (me.is_dynamic) acceptor_.ring();
}

bool PooledExecution::yields_lead(Lead& lead) noexcept {
  if (pool_.has_stuck_call()) find_help(lead);
  if (pool_.has_call_to_run()) return true;
  pool_.yield_lock();
  return false;
}

void PooledExecution::sleep(Lead& lead, MonotonicTime until) noexcept {
  pool_.unlock();
  Execution::sleep(lead, until);
  pool_.lock();
}

// Requests a dynamic thread, and borrows threads of lower lanes, as all of this lane's threads are
// busy.
void PooledExecution::find_help(Lead&) noexcept {
  if (pool_.ask_for_thread(rt::now())) acceptor_.ring();
  while (pool_.has_stuck_call() && borrow() == BorrowedThread::kGiven) {
  }
}

// Lets a thread of a lower lane run the most urgent waiting call.
BorrowedThread PooledExecution::borrow() noexcept {
  const BorrowRequest request{*this, number_, pool_.first(), pool_.queued_count()};
  BorrowedThread best = BorrowedThread::kNone;
  for (PooledExecution* lane = lower_; lane != nullptr && best != BorrowedThread::kGiven;
       lane = lane->lower_) {
    const BorrowedThread borrowed = lane->pool_.lend(request);
    if (borrowed != BorrowedThread::kNone) best = borrowed;
  }
  if (best == BorrowedThread::kGiven) {
    static_cast<void>(pool_.take_any());
    pool_.begin_borrowed_run();
  }
  return best;
}

// The most urgent higher lane that asked for a thread without success, or null.
PooledExecution* PooledExecution::next_borrower() noexcept {
  const auto number = pool_.take_borrower();
  if (!number) return nullptr;
  PooledExecution* lane = upper_;
  while (lane->number_ != *number)
    lane = lane->upper_;
  return lane;
}

// Lets the calling thread run calls of a higher lane: `call`, or those that need a thread there.
void PooledExecution::help(PooledExecution& borrower, PendingCall* call) noexcept {
  // Calls of this lane may wait for a thread that finds no work there.
  if (call == nullptr) pool_.expect_back();
  pool_.unlock();
  borrower.run_borrowed(call, pool_);
  rt::adopt_priority(parts_.config.priority);
  pool_.lock();
  pool_.end_expecting();
}

// Runs `call`, unless null, and all stuck calls, on a thread of a lower lane. The lender expects
// its thread back after the end of each call.
void PooledExecution::run_borrowed(PendingCall* call, ThreadPool& lender) noexcept {
  Lead& lead = pool_.lock_as_follower();
  while (call != nullptr || (!pool_.is_over() && pool_.has_stuck_call())) {
    if (call == nullptr) {
      lender.end_expecting();
      call = pool_.take_any();
      pool_.begin_borrowed_run();
    }
    ++parts_.report.counters(lead).borrowed_count;
    run(*call, &lender);
    call = nullptr;
  }
  pool_.unlock();
}

// Runs a call without the lock, then ends it with the lock. `lender` owns the thread, if not null.
void PooledExecution::run(PendingCall& call, ThreadPool* lender) noexcept {
  pool_.unlock();
  CallDeferral deferral(parts_.calls.pool(), call);
  Ran ran;
  if (!call.is_awaited.load(std::memory_order_acquire)) {
    ran.result.status = wire::Status::kCancelled;
  } else if (rt::now() >= call.request.deadline) {
    ran.result.status = wire::Status::kExpired;
  } else {
    const Target target{call.object, call.origin ? &*call.origin : nullptr};
    ran = parts_.dispatch.run(target, call.request, call.reply, deferral);
  }
  Lead& lead = pool_.lock_as_follower();
  end_run(lead, call, ran, deferral.is_taken());
  // An answered caller may call again at once, in this thread's own lane.
  if (lender != nullptr) lender->expect_back();
  const MonotonicTime now = rt::now();
  LaneSample& sample = parts_.report.sample(lead);
  sample.longest_cycle_ns =
      std::max(sample.longest_cycle_ns, std::int64_t{(now - call.request.received).count()});
  sample.queued_count = pool_.queued_count();
  parts_.calls.serve(lead, call);
  pool_.end_run();
  parts_.calls.publish(lead);
  const Pause pause = pause_after_work(rt::this_thread_budget(), now, rt::now);
  if (pause.kind == Pause::Kind::kNone) return;
  ++parts_.report.sample(lead).pause_count;
  sleep(lead, pause.until);
}

void PooledExecution::end_run(Lead& lead, PendingCall& call, const Ran& ran,
                              bool is_deferred) noexcept {
  ServerCounters& counters = parts_.report.counters(lead);
  counters.servant_failure_count += ran.has_thrown ? 1 : 0;
  counters.bad_request_count += ran.result.status == wire::Status::kBadRequest ? 1U : 0U;
  call.is_running = false;
  if (is_deferred) {
    ++counters.deferred_count;
    return;
  }
  RTPM_ASSERT(ran.result.reply_size <= call.reply.size(), "a reply stays within its buffer");
  call.status = ran.result.status;
  call.size = ran.result.reply_size;
  call.is_ended.store(true, std::memory_order_release);
}

ConstBytes PooledExecution::accept(Lead& lead, wire::ServerSessions& sessions,
                                   const wire::Request& request) noexcept {
  if (request.header.service == wire::kSessionService) return run_now(lead, sessions, request);
  const auto target = parts_.dispatch.target_of(request, &sessions);
  if (!target) {
    parts_.report.on_answered(lead, request.received);
    return answer(sessions, request, target.error());
  }
  PendingCall* const call = take_place();
  if (call != nullptr) {
    call->take_in(request, sessions);
    call->request.payload = ConstBytes(call->request_room).first(request.payload.size());
    std::ranges::copy(request.payload, call->request_room.begin());
  }
  if (call == nullptr || !enqueue(lead, *call, *target)) {
    return answer(sessions, request, refuse(lead));
  }
  sessions.set_tag(request, parts_.calls.pool()->tag_of(*call));
  if (!request.wants_receipt()) return {};
  return sessions.accept(request, wire::Status::kOk, request.received);
}

void PooledExecution::accept(Lead& lead, LocalChannel& channel) noexcept {
  const wire::Request request = request_of(channel);
  const auto target = parts_.dispatch.target_of(request, nullptr);
  if (!target) return channel.finish(target.error(), 0);
  if (PendingCall* const call = take_place()) {
    // Several threads may run calls from slots concurrently, and the slots share one reply buffer.
    call->take_in(request, channel, /*is_elsewhere=*/channel.is_place());
    if (enqueue(lead, *call, *target)) return;
  }
  channel.finish(refuse(lead), 0);
}

// Returns a slot for a call; null if all are in use, or the lane stops.
PendingCall* PooledExecution::take_place() noexcept {
  return parts_.is_stopping.load(std::memory_order_relaxed) ? nullptr : parts_.calls.pool()->take();
}

// Queues a call if there is space or another lane helps; otherwise releases it.
bool PooledExecution::enqueue(Lead& lead, PendingCall& call, const Target& target) noexcept {
  const std::size_t size = call.request.payload.size();
  const bool has_place = pool_.has_place_for(size);
  call.object = target.object;
  // By the time the call runs, the lane may have reused the session's slot.
  if (target.origin != nullptr) call.origin = *target.origin;
  call.is_running = true;
  pool_.enqueue(call, parts_.dispatch.priority_of(*target.object, call.request.header), size);
  if (!has_place && borrow() == BorrowedThread::kNone) {
    pool_.withdraw(call);
    parts_.calls.pool()->give_back(call);
    return false;
  }
  ServerCounters& counters = parts_.report.counters(lead);
  ++counters.call_count;
  counters.queued_count_max =
      std::max<std::uint64_t>(counters.queued_count_max, pool_.queued_count());
  parts_.report.sample(lead).queued_count = pool_.queued_count();
  parts_.idling.on_call(call.request.header.session, call.request.received);
  return true;
}

// Counts a call that is not queued, and returns the reason.
wire::Status PooledExecution::refuse(Lead& lead) noexcept {
  ++parts_.report.counters(lead).overload_count;
  return parts_.is_stopping.load(std::memory_order_relaxed) ? wire::Status::kStopping
                                                            : wire::Status::kOverload;
}

void PooledExecution::refuse_waiting(Lead& lead) noexcept {
  while (PendingCall* const call = pool_.take_any()) {
    call->is_running = false;
    call->status = wire::Status::kStopping;
    call->size = 0;
    call->is_ended.store(true, std::memory_order_release);
    parts_.calls.serve(lead, *call);
  }
}

}  // namespace rtpm::rpc
