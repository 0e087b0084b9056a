#include "rtpm/rpc/completions.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <mutex>

#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/pi_mutex.hpp"
#include "rtpm/transport/merged_descriptor.hpp"
#include "rtpm/transport/socket.hpp"

namespace rtpm::rpc {

Completions::Completions() noexcept = default;

Completions::~Completions() {
  cancel_all();
}

void Completions::cancel_all() {
  // Callbacks may add calls, which must be cancelled, too.
  while (!open_.empty()) {
    Entry& last = *open_.back();
    last.end(CallError::kCancelled);
    complete(last);
  }
}

expected<int, SetupError> Completions::descriptor() {
  if (!merged_) {
    auto opened = transport::MergedDescriptor::open();
    if (!opened) return unexpected{std::move(opened.error())};
    merged_ = std::move(*opened);
    set_alarm();
  }
  return merged_->number();
}

CallNumber Completions::add(std::unique_ptr<Entry> entry) {
  entry->number_ = next_number_++;
  if (!descriptor()) entry->end(CallError::kNoResources);
  open_.push_back(std::move(entry));
  Entry& added = *open_.back();
  watch(added, added.begin());
  set_alarm();
  return added.number_;
}

void Completions::cancel(CallNumber number) {
  Entry* const entry = find(number);
  if (entry == nullptr) return;
  entry->end(CallError::kCancelled);
  entry->due_ = {};
  set_alarm();
}

std::vector<std::unique_ptr<Completions::Entry>>::iterator Completions::find_from(
    CallNumber number) noexcept {
  return std::ranges::lower_bound(open_, number, {}, [](const auto& e) { return e->number_; });
}

Completions::Entry* Completions::find(CallNumber number) noexcept {
  const auto at = find_from(number);
  return at != open_.end() && (*at)->number_ == number ? at->get() : nullptr;
}

// The callbacks that a step runs may add, cancel and poll calls: only `entry` itself stays valid.
std::size_t Completions::step(Entry& entry) {
  const std::size_t count = entry.item_count_;
  entry.due_ = kNever;
  entry.is_in_step_ = true;
  const Readiness next = entry.step();
  entry.is_in_step_ = false;
  const std::size_t item_count = entry.item_count_ - count;
  if (!next.is_ready) {
    watch(entry, next);
    return item_count;
  }
  complete(entry);
  return item_count + 1;
}

void Completions::watch(Entry& entry, const Readiness& next) noexcept {
  entry.due_ = next.due;
  if (next.descriptor < 0) return;
  if (merged_->watch(next.descriptor, entry.number_)) {
    entry.descriptor_ = next.descriptor;
  } else {
    entry.end(CallError::kNoResources);
    entry.due_ = {};
  }
}

void Completions::complete(Entry& entry) {
  const auto at = find_from(entry.number_);
  const std::unique_ptr<Entry> ended = std::move(*at);
  open_.erase(at);
  if (ended->descriptor_ >= 0) merged_->unwatch(ended->descriptor_);
  ended->complete();
}

// Moves the alarm only if it is too late, or has gone off with nothing due: one that is too early
// costs less, and one that has gone off stays readable.
void Completions::set_alarm() noexcept {
  MonotonicTime next = kNever;
  for (const std::unique_ptr<Entry>& entry : open_)
    next = std::min(next, entry->due_);
  const MonotonicTime now = rt::now();
  const bool is_right = alarm_ <= now ? next <= now : next >= alarm_;
  if (!merged_ || is_right) return;
  alarm_ = next;
  merged_->set_alarm(alarm_);
}

std::size_t Completions::poll() {
  std::array<CallNumber, 64> room;
  if (merged_) {
    for (const CallNumber number : merged_->take(room)) {
      // The call may have ended meanwhile, or run this callback: step() watches it again.
      Entry* const entry = find(number);
      if (entry != nullptr && !entry->is_in_step_) entry->due_ = {};
    }
  }
  const MonotonicTime now = rt::now();
  const CallNumber end = next_number_;
  std::size_t count = 0;
  for (CallNumber number = 0;;) {
    const auto at = std::find_if(find_from(number), open_.end(), [&](const auto& entry) {
      return entry->due_ <= now && !entry->is_in_step_;
    });
    if (at == open_.end() || (*at)->number_ >= end) break;
    number = (*at)->number_ + 1;
    count += step(**at);
  }
  set_alarm();
  return count;
}

std::size_t Completions::wait(MonotonicTime until) {
  while (true) {
    const std::size_t count = poll();
    if (count > 0 || open_.empty() || rt::now() >= until) return count;
    transport::wait_readable(merged_->number(), until);
  }
}

class CompletionThread::Impl {
 public:
  [[nodiscard]] expected<void, SetupError> start(const rt::ThreadConfig& config) {
    if (auto opened = completions_.descriptor(); !opened) return unexpected{opened.error()};
    auto thread = rt::Thread::start(config, [this] { run(); });
    if (!thread) return unexpected{thread.error()};
    thread_ = std::move(*thread);
    return {};
  }

  void add(std::unique_ptr<Completions::Entry> entry) {
    {
      const std::lock_guard lock(mutex_);
      added_.push_back(std::move(entry));
    }
    completions_.merged_->ring();
  }

  void stop() noexcept {
    is_stopping_ = true;
    completions_.merged_->ring();
    thread_.join();
  }

 private:
  void run() {
    // poll() takes the rings, so a call that is added after it ends the next wait.
    while (take_added()) {
      transport::wait_readable(completions_.merged_->number(), kNever);
      (void)completions_.poll();
    }
    completions_.cancel_all();
  }

  /// False when stopping.
  bool take_added() {
    const std::lock_guard lock(mutex_);
    for (std::unique_ptr<Completions::Entry>& entry : added_)
      completions_.add(std::move(entry));
    added_.clear();
    return !is_stopping_;
  }

  Completions completions_;
  rt::PiMutex mutex_;
  std::vector<std::unique_ptr<Completions::Entry>> added_;
  std::atomic<bool> is_stopping_{false};
  rt::Thread thread_{};
};

CompletionThread::CompletionThread(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}

expected<std::unique_ptr<CompletionThread>, SetupError> CompletionThread::start(
    const rt::ThreadConfig& config) {
  auto impl = std::make_unique<Impl>();
  if (auto started = impl->start(config); !started) return unexpected{started.error()};
  return std::unique_ptr<CompletionThread>(new CompletionThread(std::move(impl)));
}

CompletionThread::~CompletionThread() {
  impl_->stop();
}

void CompletionThread::add(std::unique_ptr<Completions::Entry> entry) {
  impl_->add(std::move(entry));
}

}  // namespace rtpm::rpc
