#include "rtpm/gvd/stop_keeper.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <utility>
#include <vector>

#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/semaphore.hpp"
#include "rtpm/rt/thread.hpp"
#include "stops/stop_file.hpp"

namespace rtpm::gvd {
namespace {

constexpr Duration kWriteRetry = std::chrono::seconds{1};
constexpr std::uint64_t kNoRequest = 0;

/// One device: its stop in memory and in its file.
class KeptStop final : public StopMemory {
 public:
  KeptStop(std::string name, StopFile file, StopState loaded, rt::Semaphore& has_changed)
      : name_(std::move(name)),
        file_(std::move(file)),
        written_(std::move(loaded)),
        was_stopped_(written_.is_stopped),
        has_changed_(has_changed) {
    for (const std::uint64_t id : written_.obeyed)
      remember(id);
  }

  [[nodiscard]] bool was_stopped() const noexcept override { return was_stopped_; }
  void on_change() noexcept override { has_changed_.post(); }

  void attach(DeviceServer& device) noexcept { device_ = &device; }
  void stop() noexcept { device_->emergency_stop(); }
  bool obey(std::uint64_t id) noexcept {
    if (knows(id)) return false;
    device_->emergency_stop();
    // After the stop, so that write() does not see the stop as rearmed.
    in_force_.store(id, std::memory_order_release);
    remember(id);
    has_changed_.post();
    return true;
  }
  [[nodiscard]] std::uint64_t in_force() const noexcept {
    return device_->is_stopped() ? in_force_.load(std::memory_order_acquire) : kNoRequest;
  }

  /// Updates the file, on the keeper's thread; false if it could not be written.
  bool write(DeviceListener* listener) {
    std::uint64_t in_force = in_force_.load(std::memory_order_acquire);
    StopState state = present();
    if (!state.is_stopped) in_force_.compare_exchange_strong(in_force, kNoRequest);
    if (state == written_) {
      has_failed_ = false;
      return true;
    }
    const bool is_told = state.is_stopped == written_.is_stopped && !has_failed_;
    const auto saved = file_.save(state);
    if (!saved) {
      if (!std::exchange(has_failed_, true)) report(listener, failure_text(state, saved.error()));
      return false;
    }
    has_failed_ = false;
    written_ = std::move(state);
    if (!is_told) report(listener, success_text());
    return true;
  }

 private:
  [[nodiscard]] bool knows(std::uint64_t id) const noexcept {
    return std::ranges::any_of(obeyed_, [id](const std::atomic<std::uint64_t>& one) {
      return one.load(std::memory_order_relaxed) == id;
    });
  }
  void remember(std::uint64_t id) noexcept {
    const std::uint64_t number = obeyed_count_.fetch_add(1, std::memory_order_relaxed);
    obeyed_[number % obeyed_.size()].store(id, std::memory_order_release);
  }
  [[nodiscard]] StopState present() const {
    StopState state{.is_stopped = device_->is_stopped()};
    const std::uint64_t end = obeyed_count_.load(std::memory_order_relaxed);
    const std::uint64_t count = std::min<std::uint64_t>(end, obeyed_.size());
    for (std::uint64_t number = end - count; number < end; ++number) {
      const std::uint64_t id = obeyed_[number % obeyed_.size()].load(std::memory_order_acquire);
      if (id != kNoRequest) state.obeyed.push_back(id);
    }
    return state;
  }
  [[nodiscard]] std::string success_text() const {
    return written_.is_stopped
               ? "emergency stop; it lasts until the device is rearmed, also if this program ends"
               : "the emergency stop was ended: the device is rearmed";
  }
  [[nodiscard]] static std::string failure_text(const StopState& state, const SetupError& error) {
    return std::string(state.is_stopped ? "emergency stop, but IT ENDS WITH THIS PROGRAM: "
                                        : "the device is rearmed, but stopped after a restart: ") +
           error.text() + " It is tried again each second.";
  }
  void report(DeviceListener* listener, const std::string& text) const {
    if (listener != nullptr) listener->report(name_ + ": " + text);
  }

  std::string name_;
  StopFile file_;
  StopState written_;  ///< Used by the keeper thread only, like `has_failed_`.
  bool has_failed_ = false;
  bool was_stopped_;
  rt::Semaphore& has_changed_;
  DeviceServer* device_ = nullptr;
  std::array<std::atomic<std::uint64_t>, StopState::kObeyedCountMax> obeyed_{};
  std::atomic<std::uint64_t> obeyed_count_{0};
  std::atomic<std::uint64_t> in_force_{kNoRequest};
};

}  // namespace

struct StopKeeper::Impl {
  explicit Impl(StopKeeperConfig given) : config(std::move(given)) {}

  void run() {
    while (!is_stopping.load(std::memory_order_acquire)) {
      static_cast<void>(has_changed.wait_until(write_all() ? kNever : rt::now() + kWriteRetry));
    }
    write_all();
  }

  bool write_all() {
    bool is_written = true;
    for (const auto& device : devices)
      is_written = device->write(config.listener) && is_written;
    return is_written;
  }

  void report(const std::string& text) const {
    if (config.listener != nullptr) config.listener->report(text);
  }

  StopKeeperConfig config;
  rt::Semaphore has_changed{};
  std::vector<std::unique_ptr<KeptStop>> devices{};
  std::unique_ptr<KeptStop> added{};  ///< Has no server yet, whose creation may still fail.
  std::atomic<bool> is_stopping{false};
  rt::Thread thread{};
};

StopKeeper::StopKeeper(StopKeeperConfig config)
    : impl_(std::make_unique<Impl>(std::move(config))) {}
StopKeeper::~StopKeeper() {
  stop();
}

StopMemory& StopKeeper::add(std::string_view name, const driver::Descriptor& descriptor) {
  const std::string device(name);
  StopFile file(impl_->config.folder, descriptor.model, descriptor.serial);
  expected<StopState, SetupError> state = StopState{};
  if (!impl_->config.folder.empty()) state = file.load();
  if (!state) {
    impl_->report(device + ": " + state.error().text());
    state = StopState{.is_stopped = true};
  } else if (state->is_stopped) {
    impl_->report(device + ": it was stopped before this program began, and still is; `rtpm " +
                  "take-over " + device + " rearm` ends that");
  }
  impl_->added =
      std::make_unique<KeptStop>(device, std::move(file), std::move(*state), impl_->has_changed);
  return *impl_->added;
}

void StopKeeper::attach(DeviceServer& device) noexcept {
  impl_->added->attach(device);
  impl_->devices.push_back(std::move(impl_->added));
}

expected<void, SetupError> StopKeeper::start() {
  if (impl_->config.folder.empty()) return {};
  auto thread = rt::Thread::start({.name = "stops", .realtime = rt::RealtimeMode::kOff},
                                  [impl = impl_.get()] { impl->run(); });
  if (!thread) return unexpected{std::move(thread.error())};
  impl_->thread = std::move(*thread);
  return {};
}

void StopKeeper::stop() noexcept {
  impl_->is_stopping.store(true, std::memory_order_release);
  impl_->has_changed.post();
  if (impl_->thread.is_running()) impl_->thread.join();
}

void StopKeeper::stop_devices() noexcept {
  for (const auto& device : impl_->devices)
    device->stop();
}

bool StopKeeper::obey(std::uint64_t id) noexcept {
  bool is_new = false;
  for (const auto& device : impl_->devices)
    is_new = device->obey(id) || is_new;
  return is_new;
}

std::uint64_t StopKeeper::obeyed() const noexcept {
  for (const auto& device : impl_->devices) {
    if (const std::uint64_t id = device->in_force(); id != kNoRequest) return id;
  }
  return kNoRequest;
}

}  // namespace rtpm::gvd
