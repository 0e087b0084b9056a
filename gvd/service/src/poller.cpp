#include "rtpm/gvd/poller.hpp"

#include <algorithm>
#include <atomic>
#include <utility>

#include "rtpm/gvd/wire.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::gvd {
namespace {

constexpr double kRateMinHz = 0.1;
constexpr double kRateMaxHz = 10000;
/// The longest sleep of a poller, and so the longest that stop() waits for it.
constexpr Duration kSleepMax = std::chrono::milliseconds{100};
constexpr int kNoError = -1;

}  // namespace

struct DevicePoller::Impl {
  Impl(device::DeviceClient bound, const DevicePollerConfig& config, SampleSink& receiver)
      : stub(std::move(bound)),
        period(std::chrono::duration_cast<Duration>(
            std::chrono::duration<double>(1.0 / config.rate_hz))),
        priority(config.thread.priority.value_or(config.priority)),
        sink(receiver) {}
  ~Impl() { stop(); }

  expected<void, SetupError> start(const rt::ThreadConfig& config) {
    auto started = rt::Thread::start(config, [this] { loop(); });
    if (!started) return unexpected{std::move(started.error())};
    thread = std::move(*started);
    return {};
  }

  void stop() noexcept {
    is_stopping.store(true, std::memory_order_relaxed);
    if (thread.is_running()) thread.join();
  }

  void loop() {
    MonotonicTime due = rt::now();
    while (!is_stopping.load(std::memory_order_relaxed)) {
      poll();
      due = std::max(due + period, rt::now());
      while (!is_stopping.load(std::memory_order_relaxed) && rt::now() < due) {
        rt::sleep_until(std::min(due, rt::now() + kSleepMax));
      }
    }
  }

  void poll() {
    rpc::CallOptions options;
    options.priority = priority;
    const auto sample = stub.read({}, options);
    if (!sample) {
      failed_count.fetch_add(1, std::memory_order_relaxed);
      last_error.store(static_cast<int>(sample.error()), std::memory_order_relaxed);
      return;
    }
    last_error.store(kNoError, std::memory_order_relaxed);
    // A restarted server counts from one again: any different number is new.
    if (sample->sequence() == last_sequence) {
      unchanged_count.fetch_add(1, std::memory_order_relaxed);
      return;
    }
    last_sequence = sample->sequence();
    pushed_count.fetch_add(1, std::memory_order_relaxed);
    sink.push(from_wire(*sample));
  }

  device::DeviceClient stub;
  Duration period;
  Priority priority;
  SampleSink& sink;
  std::uint64_t last_sequence = 0;
  std::atomic<std::uint64_t> pushed_count{0};
  std::atomic<std::uint64_t> unchanged_count{0};
  std::atomic<std::uint64_t> failed_count{0};
  std::atomic<int> last_error{kNoError};
  std::atomic<bool> is_stopping{false};
  rt::Thread thread{};
};

expected<DevicePoller, SetupError> DevicePoller::start(rpc::Node& node, std::string_view device,
                                                       const DevicePollerConfig& config,
                                                       SampleSink& sink) {
  if (!(config.rate_hz >= kRateMinHz && config.rate_hz <= kRateMaxHz)) {
    return setup_error("a poller's rate is out of range", "", "choose 0.1 to 10000 Hz");
  }
  rpc::BindOptions bind;
  bind.warm_up = {config.thread.priority.value_or(config.priority)};
  auto stub = device::DeviceClient::bind(node, device, bind);
  if (!stub) return unexpected{stub.error()};
  auto impl = std::make_unique<Impl>(std::move(*stub), config, sink);
  if (auto started = impl->start(config.thread); !started) return unexpected{started.error()};
  return DevicePoller{std::move(impl)};
}

DevicePoller::DevicePoller(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
DevicePoller::DevicePoller(DevicePoller&&) noexcept = default;
DevicePoller& DevicePoller::operator=(DevicePoller&&) noexcept = default;
DevicePoller::~DevicePoller() = default;

void DevicePoller::stop() noexcept {
  impl_->stop();
}

DevicePollerCounters DevicePoller::counters() const noexcept {
  return {impl_->pushed_count.load(std::memory_order_relaxed),
          impl_->unchanged_count.load(std::memory_order_relaxed),
          impl_->failed_count.load(std::memory_order_relaxed)};
}

std::optional<rpc::CallError> DevicePoller::last_error() const noexcept {
  const int error = impl_->last_error.load(std::memory_order_relaxed);
  if (error == kNoError) return std::nullopt;
  return static_cast<rpc::CallError>(error);
}

}  // namespace rtpm::gvd
