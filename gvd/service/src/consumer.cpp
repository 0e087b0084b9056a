#include "rtpm/gvd/consumer.hpp"

#include <algorithm>
#include <atomic>
#include <utility>

#include "rtpm/rt/clock.hpp"
#include "wire.hpp"

namespace rtpm::gvd {
namespace {

constexpr double kRateMinHz = 0.1;
constexpr double kRateMaxHz = 10000;
/// How long stop() may wait for a sleeping consumer.
constexpr Duration kSleepMax = std::chrono::milliseconds{100};
constexpr int kNoError = -1;

}  // namespace

class DeviceConsumer::Impl {
 public:
  Impl(device::DeviceClient stub, const DeviceConsumerConfig& config, SampleSink& sink)
      : stub_(std::move(stub)),
        period_(std::chrono::duration_cast<Duration>(
            std::chrono::duration<double>(1.0 / config.rate_hz))),
        priority_(config.thread.priority.value_or(config.priority)),
        sink_(sink) {}
  ~Impl() { stop(); }

  expected<void, rpc::SetupError> start(const rt::ThreadConfig& config) {
    auto thread = rt::Thread::start(config, [this] { loop(); });
    if (!thread) return rpc::setup_error(thread.error().text);
    thread_ = std::move(*thread);
    return {};
  }

  void stop() noexcept {
    is_stopping_.store(true, std::memory_order_relaxed);
    if (thread_.is_running()) thread_.join();
  }

  [[nodiscard]] DeviceConsumerCounters counters() const noexcept {
    return {pushed_count_.load(std::memory_order_relaxed),
            unchanged_count_.load(std::memory_order_relaxed),
            failed_count_.load(std::memory_order_relaxed)};
  }
  [[nodiscard]] std::optional<rpc::CallError> last_error() const noexcept {
    const int error = last_error_.load(std::memory_order_relaxed);
    if (error == kNoError) return std::nullopt;
    return static_cast<rpc::CallError>(error);
  }

 private:
  void loop() {
    MonotonicTime due = rt::now();
    while (!is_stopping_.load(std::memory_order_relaxed)) {
      look();
      due = std::max(due + period_, rt::now());
      while (!is_stopping_.load(std::memory_order_relaxed) && rt::now() < due) {
        rt::sleep_until(std::min(due, rt::now() + kSleepMax));
      }
    }
  }

  void look() {
    rpc::CallOptions options;
    options.priority = priority_;
    const auto sample = stub_.read({}, options);
    if (!sample) {
      failed_count_.fetch_add(1, std::memory_order_relaxed);
      last_error_.store(static_cast<int>(sample.error()), std::memory_order_relaxed);
      return;
    }
    last_error_.store(kNoError, std::memory_order_relaxed);
    // A restarted server counts from one again: any different number is new.
    if (sample->sequence() == last_sequence_) {
      unchanged_count_.fetch_add(1, std::memory_order_relaxed);
      return;
    }
    last_sequence_ = sample->sequence();
    pushed_count_.fetch_add(1, std::memory_order_relaxed);
    sink_.push(from_wire(*sample));
  }

  device::DeviceClient stub_;
  Duration period_;
  Priority priority_;
  SampleSink& sink_;
  std::uint64_t last_sequence_ = 0;
  std::atomic<std::uint64_t> pushed_count_{0};
  std::atomic<std::uint64_t> unchanged_count_{0};
  std::atomic<std::uint64_t> failed_count_{0};
  std::atomic<int> last_error_{kNoError};
  std::atomic<bool> is_stopping_{false};
  rt::Thread thread_{};
};

expected<DeviceConsumer, rpc::SetupError> DeviceConsumer::start(rpc::Node& node,
                                                                std::string_view device,
                                                                const DeviceConsumerConfig& config,
                                                                SampleSink& sink) {
  if (!(config.rate_hz >= kRateMinHz && config.rate_hz <= kRateMaxHz)) {
    return rpc::setup_error("a consumer's rate is 0.1 to 10000 Hz");
  }
  rpc::BindOptions bind;
  bind.warm_up = {config.thread.priority.value_or(config.priority)};
  auto stub = device::DeviceClient::bind(node, device, bind);
  if (!stub) return unexpected{stub.error()};
  auto impl = std::make_unique<Impl>(std::move(*stub), config, sink);
  if (auto started = impl->start(config.thread); !started) return unexpected{started.error()};
  return DeviceConsumer{std::move(impl)};
}

DeviceConsumer::DeviceConsumer(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
DeviceConsumer::DeviceConsumer(DeviceConsumer&&) noexcept = default;
DeviceConsumer& DeviceConsumer::operator=(DeviceConsumer&&) noexcept = default;
DeviceConsumer::~DeviceConsumer() = default;

void DeviceConsumer::stop() noexcept {
  impl_->stop();
}

DeviceConsumerCounters DeviceConsumer::counters() const noexcept {
  return impl_->counters();
}

std::optional<rpc::CallError> DeviceConsumer::last_error() const noexcept {
  return impl_->last_error();
}

}  // namespace rtpm::gvd
