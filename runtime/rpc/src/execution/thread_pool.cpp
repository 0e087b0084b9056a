#include "execution/thread_pool.hpp"

#include <algorithm>
#include <bit>
#include <utility>

#include "rtpm/base/assert.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::rpc {
namespace {

// If the system refuses a thread, an immediate retry would fail, too.
constexpr Duration kRefusedPause = std::chrono::milliseconds{100};

}  // namespace

ThreadPool::ThreadPool(const LaneConfig& config, std::uint32_t call_count_max,
                       transport::WaitSet& leader)
    : leader_(leader),
      workers_(static_count(config) + config.dynamic_threads),
      buffered_request_max_(config.buffered_request_max),
      buffered_byte_max_(config.buffered_byte_max),
      dynamic_count_max_(config.dynamic_threads) {
  resting_.reserve(workers_.size());
  called_.reserve(workers_.size());
  queue_.reserve(call_count_max);
  for (std::size_t i = static_count(config); i < workers_.size(); ++i)
    workers_[i].is_dynamic = true;
}

Lead& ThreadPool::lock_as_follower() noexcept {
  follower_count_.fetch_add(1, std::memory_order_relaxed);
  mutex_.lock();
  follower_count_.fetch_sub(1, std::memory_order_relaxed);
  return lead_;
}

void ThreadPool::yield_lock() noexcept {
  if (borrowers_.load(std::memory_order_acquire) != 0) call_helper();
  if (follower_count_.load(std::memory_order_relaxed) == 0) return;
  // The kernel gives the lock to the most urgent waiter; this thread queues after it.
  mutex_.unlock();
  mutex_.lock();
}

// Wakes a thread to look for a borrower, unless a woken one will do so anyway.
void ThreadPool::call_helper() noexcept {
  if (!called_.empty() || resting_.empty()) return;
  Worker* const worker = resting_.back();
  resting_.pop_back();
  called_.push_back(worker);
  worker->wake.post();
}

bool ThreadPool::has_place_for(std::size_t size) const noexcept {
  const std::size_t startable = resting_.size() + called_.size() +
                                coming_back_.load(std::memory_order_relaxed) + dynamic_count_max_ -
                                dynamic_count_;
  if (queue_.size() < startable) return true;
  return queue_.size() < startable + buffered_request_max_ &&
         queued_bytes_ + size <= buffered_byte_max_;
}

void ThreadPool::enqueue(PendingCall& call, Priority priority, std::size_t size) noexcept {
  RTPM_ASSERT(queue_.size() < queue_.capacity(), "as many wait as there are places for calls");
  queue_.push_back({&call, priority, ++serial_, size});
  std::push_heap(queue_.begin(), queue_.end());
  queued_bytes_ += size;
}

PendingCall* ThreadPool::take_any() noexcept {
  if (queue_.empty()) return nullptr;
  std::pop_heap(queue_.begin(), queue_.end());
  const Waiting first = queue_.back();
  queue_.pop_back();
  queued_bytes_ -= first.size;
  return first.call;
}

void ThreadPool::withdraw(const PendingCall& call) noexcept {
  const auto place = std::ranges::find(queue_, &call, &Waiting::call);
  RTPM_ASSERT(place != queue_.end(), "only what waits is withdrawn");
  queued_bytes_ -= place->size;
  queue_.erase(place);
  std::make_heap(queue_.begin(), queue_.end());
}

PendingCall* ThreadPool::take_to_run() noexcept {
  if (!has_lead_ && !has_follower()) return nullptr;
  PendingCall* const call = take_any();
  if (call != nullptr) ++running_count_;
  return call;
}

bool ThreadPool::take_lead() noexcept {
  return !std::exchange(has_lead_, true);
}

void ThreadPool::leave_lead() noexcept {
  has_lead_ = false;
  call_helper();
}

bool ThreadPool::rest(Worker& worker, Duration patience) noexcept {
  // Static threads are woken first, so that dynamic ones may end.
  if (worker.is_dynamic) {
    resting_.insert(resting_.begin(), &worker);
  } else {
    resting_.push_back(&worker);
  }
  publish_spare();
  mutex_.unlock();
  const MonotonicTime until = worker.is_dynamic ? rt::now() + patience : kNever;
  bool is_called = worker.wake.wait_until(until);
  lock();
  if (!is_called) {
    const auto place = std::ranges::find(resting_, &worker);
    if (place != resting_.end()) {
      resting_.erase(place);
      publish_spare();
      return false;
    }
    // Called just before the time-out: the signal is posted, or about to be.
    is_called = worker.wake.wait_until(kNever);
  }
  std::erase(called_, &worker);
  publish_spare();
  return true;
}

BorrowedThread ThreadPool::lend(const BorrowRequest& request) noexcept {
  const std::uint64_t bit = std::uint64_t{1} << request.borrower_number;
  const bool is_locked = mutex_.try_lock();
  const bool is_given = is_locked && give_thread(request);
  const std::uint64_t before = is_given ? borrowers_.fetch_and(~bit, std::memory_order_relaxed)
                                        : borrowers_.fetch_or(bit, std::memory_order_release);
  if (is_locked) mutex_.unlock();
  if (is_given) return BorrowedThread::kGiven;
  // The lock's holder may be about to rest, after it has already looked for borrowers.
  if (!is_locked && (before & bit) == 0) leader_.ring();
  const std::uint32_t spare_count =
      spare_count_.load(std::memory_order_relaxed) + coming_back_.load(std::memory_order_relaxed);
  return spare_count >= request.waiting_count ? BorrowedThread::kSoon : BorrowedThread::kNone;
}

// Requires the lock.
bool ThreadPool::give_thread(const BorrowRequest& request) noexcept {
  if (is_over_) return false;
  Worker* worker = nullptr;
  if (!resting_.empty()) {
    worker = resting_.back();
    resting_.pop_back();
    worker->wake.post();
  } else if (has_lead_ && !called_.empty()) {
    // It was woken to take the lead, which another thread has taken since; it is on its way anyway.
    worker = called_.back();
    called_.pop_back();
  }
  if (worker == nullptr) return false;
  publish_spare();
  worker->borrower = &request.borrower;
  worker->lent_call = &request.call;
  return true;
}

std::optional<std::uint32_t> ThreadPool::take_borrower() noexcept {
  const std::uint64_t borrowers = borrowers_.load(std::memory_order_acquire);
  if (borrowers == 0) return std::nullopt;
  const auto number = static_cast<std::uint32_t>(std::bit_width(borrowers) - 1);
  borrowers_.fetch_and(~(std::uint64_t{1} << number), std::memory_order_relaxed);
  return number;
}

void ThreadPool::end() noexcept {
  is_over_ = true;
  for (Worker* const worker : resting_)
    worker->wake.post();
  resting_.clear();
  publish_spare();
}

bool ThreadPool::ask_for_thread(MonotonicTime now) noexcept {
  if (dynamic_count_ == dynamic_count_max_ || is_over_) return false;
  if (asking_.load(std::memory_order_acquire) == Asking::kRefused) {
    next_asking_ = now + kRefusedPause;
    asking_.store(Asking::kNone, std::memory_order_relaxed);
  }
  if (is_thread_wanted() || now < next_asking_) return false;
  asking_.store(Asking::kWanted, std::memory_order_release);
  return true;
}

void ThreadPool::sign_on(const Worker& worker) noexcept {
  if (!worker.is_dynamic) return;
  ++dynamic_count_;
  asking_.store(Asking::kNone, std::memory_order_release);
}

void ThreadPool::sign_off(Worker& worker) noexcept {
  if (worker.is_dynamic) --dynamic_count_;
  worker.has_ended.store(true, std::memory_order_release);
}

}  // namespace rtpm::rpc
