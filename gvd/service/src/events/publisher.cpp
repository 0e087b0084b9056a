#include "rtpm/gvd/publisher.hpp"

#include <algorithm>
#include <atomic>
#include <mutex>
#include <utility>
#include <vector>

#include "events/change_finder.hpp"
#include "events/event_wire.hpp"
#include "rtpm/base/latest.hpp"
#include "rtpm/base/ring.hpp"
#include "rtpm/events/supplier.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/pi_mutex.hpp"

namespace rtpm::gvd {
namespace {

/// Cycles of one device that wait for the publisher: 0.25 s at 1 kHz.
constexpr std::size_t kRingSize = 256;
constexpr std::size_t kConfigurationCountMax = 64;
/// Viewers draw models about 30 times per second.
constexpr Duration kModelsIntervalMin = std::chrono::milliseconds{33};
/// Models are repeated for consumers that subscribe later.
constexpr Duration kModelsRepeat = std::chrono::seconds{1};
/// A hub may start slightly later than the devices, so its absence is reported only after this
/// time.
constexpr Duration kAbsenceUntold = std::chrono::seconds{3};
constexpr std::string_view kNoHubRemedy =
    "start rtpm-eventd, or name another hub; devices work without";

/// One device: the writing end of its ring, for the device's thread.
class Source final : public CycleObserver {
 public:
  Source(std::string name, double contact_force_newton)
      : name_(std::move(name)), id_(source_of(name_)), finder_(contact_force_newton) {}

  void on_cycle(const CycleRecord& record) noexcept override {
    CycleRecord left = record;
    if (!ring_.push(left)) overrun_count_.fetch_add(1, std::memory_order_relaxed);
  }

  void on_models(const ModelsRecord& record) noexcept override { models_.write(record); }

  /// The models to push at `now`; null if that is not due.
  [[nodiscard]] const ModelsRecord* due_models(MonotonicTime now) noexcept {
    if (now < models_pushed_ + kModelsIntervalMin) return nullptr;
    if (!take_models()) {
      if (rendered_.list.is_empty() || now < models_pushed_ + kModelsRepeat) return nullptr;
      rendered_.time = now;
    }
    models_pushed_ = now;
    return &rendered_;
  }

  [[nodiscard]] std::optional<CycleRecord> pop() noexcept { return ring_.pop(); }
  [[nodiscard]] ChangeFinder& finder() noexcept { return finder_; }
  [[nodiscard]] const std::string& name() const noexcept { return name_; }
  [[nodiscard]] events::SourceId id() const noexcept { return id_; }
  [[nodiscard]] std::uint64_t overrun_count() const noexcept {
    return overrun_count_.load(std::memory_order_relaxed);
  }

 private:
  /// Takes the newest list; returns whether it differs from the last one.
  bool take_models() noexcept {
    const std::uint64_t count = models_.count();
    if (count == models_count_) return false;
    const auto newest = models_.read();
    if (!newest) return false;
    models_count_ = count;
    if (std::ranges::equal(newest->list.models(), rendered_.list.models())) return false;
    rendered_ = *newest;
    return true;
  }

  std::string name_;
  events::SourceId id_;
  SpscRing<CycleRecord, kRingSize> ring_{};
  ChangeFinder finder_;
  std::atomic<std::uint64_t> overrun_count_{0};
  Latest<ModelsRecord> models_{};
  // Used by the publisher's thread only.
  std::uint64_t models_count_ = 0;  ///< Latest::count() when it was last read.
  ModelsRecord rendered_{};         ///< As last pushed.
  MonotonicTime models_pushed_{};
};

/// An older sample was not measured in its cycle: the device reports only changes, and there were
/// none.
constexpr Duration kLatencyMax = std::chrono::seconds{1};

/// When the sample was measured, by the device's time if that is plausible.
MonotonicTime measured_at(const CycleRecord& record) noexcept {
  const MonotonicTime measured = record.sample.host_time;
  const bool is_measured = !record.sample.faults.has(driver::Fault::kImplausible) &&
                           record.time - measured <= kLatencyMax;
  return is_measured ? measured : record.time;
}

struct LeftConfiguration {
  events::SourceId source = 0;
  MonotonicTime time{};
  ConfigurationChange change{};
};

}  // namespace

struct DevicePublisher::Impl {
  Impl(rpc::Node& used, DevicePublisherConfig given) : node(used), config(std::move(given)) {}

  void run() {
    begun = rt::now();
    MonotonicTime due = begun;
    while (!is_stopping.load(std::memory_order_relaxed)) {
      reach_hub();
      push_all();
      due = std::max(due + config.interval, rt::now());
      rt::sleep_until(due);
    }
    push_all();
  }

  void reach_hub() {
    if (supplier || rt::now() < retry_at) return;
    events::SupplierConfig supplied;
    supplied.name = "devices";
    supplied.priority = config.thread.priority.value_or(Priority{});
    supplied.types = device_event_types();
    auto made = config.own_hub != nullptr ? events::Supplier::create(*config.own_hub, supplied)
                                          : events::Supplier::create(node, config.hub, supplied);
    if (made) {
      supplier = std::move(*made);
      if (std::exchange(is_absence_told, false)) report("the hub " + config.hub + " is there now");
      return;
    }
    retry_at = rt::now() + config.retry;
    if (is_absence_told || rt::now() < begun + kAbsenceUntold) return;
    is_absence_told = true;
    SetupError error = made.error();
    error.what = "events of the devices are not published: " + error.what;
    error.remedy = kNoHubRemedy;
    report(error.text());
  }

  void push_all() {
    for (const auto& source : sources) {
      while (const auto record = source->pop())
        push(*source, *record);
      push_models(*source);
    }
    push_configurations();
    if (supplier) static_cast<void>(supplier->flush());
  }

  void push(Source& source, const CycleRecord& record) {
    // The finder sees every record, even without a hub, so a later hub gets only later changes.
    const auto changes = source.finder().step(record);
    if (!supplier) {
      count(no_hub_count);
      return;
    }
    EventStamp stamp{source.id(), record.sample.sequence, measured_at(record)};
    count(add_event(*supplier, stamp, record.sample));
    stamp.time = record.time;
    for (const CycleChange& change : changes)
      count(add_event(*supplier, stamp, change));
  }

  void push_models(Source& source) {
    if (!supplier) return;
    const MonotonicTime now = rt::now();
    const ModelsRecord* const due = source.due_models(now);
    if (due == nullptr) return;
    count(add_event(*supplier, EventStamp{source.id(), due->cycle, due->time}, due->list));
  }

  void push_configurations() {
    std::vector<LeftConfiguration> taken;
    {
      const std::lock_guard lock(mutex);
      taken.swap(configurations);
    }
    for (const LeftConfiguration& left : taken) {
      if (!supplier) continue;
      count(add_event(*supplier, EventStamp{left.source, 0, left.time}, left.change));
    }
  }

  void count(const expected<void, rpc::CallError>& added) noexcept {
    count(added ? pushed_count : failed_count);
  }
  static void count(std::atomic<std::uint64_t>& counter) noexcept {
    counter.fetch_add(1, std::memory_order_relaxed);
  }
  void report(const std::string& text) const {
    if (config.listener != nullptr) config.listener->report(text);
  }

  rpc::Node& node;
  DevicePublisherConfig config;
  std::vector<std::unique_ptr<Source>> sources{};
  std::atomic<std::uint64_t> pushed_count{0};
  std::atomic<std::uint64_t> failed_count{0};
  std::atomic<std::uint64_t> no_hub_count{0};
  std::atomic<bool> is_stopping{false};
  rt::PiMutex mutex{};
  std::vector<LeftConfiguration> configurations{};  ///< Guarded by `mutex`.
  // Used by the publisher's thread only.
  std::unique_ptr<events::Supplier> supplier{};
  MonotonicTime begun{};
  MonotonicTime retry_at{};
  bool is_absence_told = false;
  rt::Thread thread{};
};

DevicePublisher::DevicePublisher(rpc::Node& node, DevicePublisherConfig config)
    : impl_(std::make_unique<Impl>(node, std::move(config))) {}

DevicePublisher::~DevicePublisher() {
  stop();
}

expected<CycleObserver*, SetupError> DevicePublisher::add(std::string_view name) {
  RTPM_ASSERT(!impl_->thread.is_running(), "devices are added before start()");
  for (const auto& source : impl_->sources) {
    if (source->id() != source_of(name)) continue;
    return setup_error("the devices " + source->name() + " and " + std::string(name) +
                           " have the same number as sources of events",
                       "", "rename one of them");
  }
  impl_->sources.push_back(
      std::make_unique<Source>(std::string(name), impl_->config.contact_force_newton));
  return impl_->sources.back().get();
}

expected<void, SetupError> DevicePublisher::start() {
  auto thread = rt::Thread::start(impl_->config.thread, [impl = impl_.get()] { impl->run(); });
  if (!thread) return unexpected{std::move(thread.error())};
  impl_->thread = std::move(*thread);
  return {};
}

void DevicePublisher::stop() noexcept {
  impl_->is_stopping.store(true, std::memory_order_relaxed);
  if (impl_->thread.is_running()) impl_->thread.join();
}

void DevicePublisher::publish_configuration(std::string_view name, std::uint64_t revision,
                                            std::span<const std::string> names) {
  const std::lock_guard lock(impl_->mutex);
  auto& left = impl_->configurations;
  // Only the newest changes matter: each has the current revision.
  if (left.size() == kConfigurationCountMax) left.erase(left.begin());
  left.push_back({source_of(name), rt::now(), {revision, {names.begin(), names.end()}}});
}

DevicePublisherCounters DevicePublisher::counters() const noexcept {
  DevicePublisherCounters counters{impl_->pushed_count.load(std::memory_order_relaxed),
                                   impl_->failed_count.load(std::memory_order_relaxed),
                                   impl_->no_hub_count.load(std::memory_order_relaxed), 0};
  for (const auto& source : impl_->sources)
    counters.overrun_count += source->overrun_count();
  return counters;
}

}  // namespace rtpm::gvd
