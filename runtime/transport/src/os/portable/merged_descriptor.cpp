#include "rtpm/transport/merged_descriptor.hpp"

#include <algorithm>
#include <cerrno>
#include <mutex>
#include <utility>
#include <vector>

#include "os/doorbell.hpp"
#include "os/native_socket.hpp"
#include "rtpm/base/assert.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/pi_mutex.hpp"
#include "rtpm/rt/thread.hpp"

namespace rtpm::transport {
namespace {

/// A thread polls the descriptors and the alarm, and makes `report_` readable.
class PolledDescriptor final : public MergedDescriptor {
 public:
  PolledDescriptor(os::Doorbell report, os::Doorbell change) noexcept
      : report_(std::move(report)), change_(std::move(change)) {}
  ~PolledDescriptor() override {
    {
      const std::lock_guard lock(mutex_);
      is_ending_ = true;
    }
    change_.ring();
  }
  [[nodiscard]] expected<void, SetupError> start() {
    auto thread = rt::Thread::start({.name = "rtpm-merged", .realtime = rt::RealtimeMode::kOff},
                                    [this] { run(); });
    if (!thread) return unexpected{std::move(thread.error())};
    thread_ = std::move(*thread);
    return {};
  }

  [[nodiscard]] int number() const noexcept override { return report_.descriptor(); }
  [[nodiscard]] bool watch(int descriptor, std::uint64_t tag) noexcept override {
    RTPM_ASSERT(tag <= kTagMax, "the highest tags are the set's own");
    if (!os::is_open(descriptor)) return false;
    {
      const std::lock_guard lock(mutex_);
      forget(descriptor);
      watched_.push_back({descriptor, tag});
    }
    change_.ring();
    return true;
  }
  void unwatch(int descriptor) noexcept override {
    {
      const std::lock_guard lock(mutex_);
      forget(descriptor);
    }
    change_.ring();
  }
  void set_alarm(MonotonicTime time) noexcept override {
    {
      const std::lock_guard lock(mutex_);
      alarm_ = time;
      has_alarmed_ = time <= rt::now();
      clear_if_idle();
      if (has_alarmed_) report_.ring();
    }
    change_.ring();
  }
  void ring() noexcept override {
    const std::lock_guard lock(mutex_);
    is_rung_ = true;
    report_.ring();
  }
  [[nodiscard]] std::span<std::uint64_t> take(std::span<std::uint64_t> ready) noexcept override {
    const std::lock_guard lock(mutex_);
    is_rung_ = false;
    const std::size_t count = std::min(ready.size(), ready_.size());
    for (std::size_t i = 0; i < count; ++i)
      ready[i] = ready_[i].tag;
    ready_.erase(ready_.begin(), ready_.begin() + static_cast<std::ptrdiff_t>(count));
    clear_if_idle();
    return ready.first(count);
  }

 private:
  struct Watched {
    int descriptor = -1;
    std::uint64_t tag = 0;
  };

  void forget(int descriptor) noexcept {
    const auto is_it = [&](const Watched& each) { return each.descriptor == descriptor; };
    std::erase_if(watched_, is_it);
    std::erase_if(ready_, is_it);
    clear_if_idle();
  }
  void clear_if_idle() noexcept {
    if (ready_.empty() && !has_alarmed_ && !is_rung_) report_.clear();
  }
  void run() {
    std::vector<pollfd> entries;
    while (true) {
      MonotonicTime until = kNever;
      {
        const std::lock_guard lock(mutex_);
        if (is_ending_) return;
        entries.assign(1, os::polled(change_.descriptor()));
        for (const Watched& each : watched_)
          entries.push_back(os::polled(each.descriptor));
        if (!has_alarmed_) until = alarm_;
      }
      static_cast<void>(os::poll_until(entries, until));
      if (entries.front().revents != 0) change_.clear();
      report(entries);
    }
  }
  void report(const std::vector<pollfd>& entries) {
    const std::lock_guard lock(mutex_);
    bool has_news = false;
    for (const pollfd& entry : entries) {
      // A closed descriptor is no longer reported.
      const auto watched = std::ranges::find(watched_, os::number_of(entry), &Watched::descriptor);
      if (entry.revents == 0 || watched == watched_.end()) continue;
      if ((entry.revents & POLLNVAL) == 0) {
        ready_.push_back(*watched);
        has_news = true;
      }
      watched_.erase(watched);
    }
    if (!has_alarmed_ && alarm_ != kNever && rt::now() >= alarm_) has_news = has_alarmed_ = true;
    if (has_news) report_.ring();
  }

  os::Doorbell report_;
  os::Doorbell change_;  ///< Rung for the thread when what it polls has changed.
  rt::PiMutex mutex_;
  // Under the mutex, from here on.
  std::vector<Watched> watched_{};
  std::vector<Watched> ready_{};  ///< To be reported, and no longer watched.
  MonotonicTime alarm_ = kNever;
  bool has_alarmed_ = false;
  bool is_rung_ = false;
  bool is_ending_ = false;
  rt::Thread thread_;  ///< Last, so that it ends first.
};

}  // namespace

expected<std::unique_ptr<MergedDescriptor>, SetupError> MergedDescriptor::open() {
  auto report = os::Doorbell::open();
  auto change = os::Doorbell::open();
  if (!report || !change) {
    return unexpected{no_descriptor("a descriptor that reports for others", errno)};
  }
  auto merged = std::make_unique<PolledDescriptor>(std::move(*report), std::move(*change));
  if (auto started = merged->start(); !started) return unexpected{std::move(started.error())};
  return std::unique_ptr<MergedDescriptor>(std::move(merged));
}

}  // namespace rtpm::transport
