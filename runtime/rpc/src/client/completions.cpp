#include "rtpm/rpc/completions.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <iterator>
#include <mutex>
#include <semaphore>

#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/pi_mutex.hpp"

namespace rtpm::rpc {
namespace {

// The longest time that waiting for one call delays polling the others and new ones.
constexpr Duration kLookInterval = std::chrono::milliseconds{1};

}  // namespace

Completions::~Completions() {
  // Callbacks may add calls, which must be cancelled, too.
  while (!open_.empty()) {
    const std::unique_ptr<Entry> entry = std::move(open_.back());
    open_.pop_back();
    entry->cancel();
    entry->complete();
  }
}

std::size_t Completions::poll() {
  // In the order in which they were added. Callbacks run after this loop, since they may add more.
  std::vector<std::unique_ptr<Entry>> ended;
  const auto is_open = [](const std::unique_ptr<Entry>& entry) {
    return !entry->wait(MonotonicTime{});
  };
  const auto first = std::stable_partition(open_.begin(), open_.end(), is_open);
  std::move(first, open_.end(), std::back_inserter(ended));
  open_.erase(first, open_.end());
  for (const std::unique_ptr<Entry>& entry : ended)
    entry->complete();
  return ended.size();
}

std::size_t Completions::wait(MonotonicTime until) {
  while (true) {
    const std::size_t count = poll();
    const MonotonicTime now = rt::now();
    if (count > 0 || open_.empty() || now >= until) return count;
    const MonotonicTime next = open_.size() == 1 ? until : std::min(until, now + kLookInterval);
    (void)open_.front()->wait(next);
  }
}

class CompletionThread::Impl {
 public:
  void add(std::unique_ptr<Completions::Entry> entry) {
    {
      const std::lock_guard lock(mutex_);
      added_.push_back(std::move(entry));
    }
    news_.release();
  }

  void run() {
    Completions completions;
    while (take_added(completions))
      (void)completions.wait(rt::now() + kLookInterval);
  }

  void stop() noexcept {
    is_stopping_ = true;
    news_.release();
    thread_.join();
  }

  rt::Thread thread_{};

 private:
  /// Waits for a new call if none is open; false when stopping.
  bool take_added(Completions& completions) {
    // A surplus signal causes an idle turn at worst.
    if (completions.open_count() == 0) news_.acquire();
    const std::lock_guard lock(mutex_);
    for (std::unique_ptr<Completions::Entry>& entry : added_)
      completions.add(std::move(entry));
    added_.clear();
    return !is_stopping_;
  }

  rt::PiMutex mutex_;
  std::vector<std::unique_ptr<Completions::Entry>> added_;
  std::counting_semaphore<> news_{0};
  std::atomic<bool> is_stopping_{false};
};

CompletionThread::CompletionThread(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}

expected<std::unique_ptr<CompletionThread>, SetupError> CompletionThread::start(
    const rt::ThreadConfig& config) {
  auto impl = std::make_unique<Impl>();
  auto thread = rt::Thread::start(config, [raw = impl.get()] { raw->run(); });
  if (!thread) return unexpected{thread.error()};
  impl->thread_ = std::move(*thread);
  return std::unique_ptr<CompletionThread>(new CompletionThread(std::move(impl)));
}

CompletionThread::~CompletionThread() {
  impl_->stop();
}

void CompletionThread::add(std::unique_ptr<Completions::Entry> entry) {
  impl_->add(std::move(entry));
}

}  // namespace rtpm::rpc
