#include "rtpm/gvd/system_stop.hpp"

#include <device_events.rtpm.events.hpp>

#include <atomic>
#include <utility>

#include "rtpm/events/consumer.hpp"
#include "rtpm/events/supplier.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/host.hpp"

namespace rtpm::gvd {
namespace {

using Event = device::StopAllRequestedEvent;
static_assert(kStopAllRequested == Event::kType);

/// Capacity for different requests, at the consumer and the hub.
constexpr std::uint32_t kQueueCapacity = 16;
constexpr std::uint64_t kNoRequest = 0;

std::uint64_t random_id() noexcept {
  std::uint64_t id = kNoRequest;
  while (id == kNoRequest)
    id = rt::random_u64();
  return id;
}

}  // namespace

struct SystemStop::Impl final : events::EventHandler {
  Impl(rpc::Node& used, SystemStopDevices* stopped, SystemStopConfig given)
      : node(used), devices(stopped), config(std::move(given)) {}

  void run() {
    while (!is_stopping.load(std::memory_order_relaxed)) {
      reach_hub();
      repeat_request();
      remind();
      rt::sleep_until(rt::now() + config.repeat);
    }
  }

  void reach_hub() {
    const bool needs_consumer = devices != nullptr && !consumer;
    if ((!needs_consumer && supplier) || rt::now() < retry_at) return;
    if (needs_consumer) subscribe();
    if (supplier == nullptr) {
      auto made = events::Supplier::create(
          node, config.hub,
          {.name = "emergency stop", .priority = config.priority, .types = {&Event::kDescriptor}});
      if (made) {
        supplier = std::move(*made);
        ready_supplier.store(supplier.get(), std::memory_order_release);
      }
    }
    retry_at = rt::now() + config.retry;
  }

  void subscribe() {
    auto made = events::Consumer::create(
        node, config.hub,
        {.name = "emergency stop",
         .filter = events::of_type(Event::kType),
         .delivery = {.queue_capacity = kQueueCapacity, .replay = kQueueCapacity},
         .priority = config.priority,
         .realtime = config.realtime,
         .types = {&Event::kDescriptor}},
        *this);
    if (!made) return;
    consumer = std::move(*made);
    is_subscribed.store(true, std::memory_order_relaxed);
  }

  void request() noexcept {
    const std::uint64_t id = random_id();
    stop_count.fetch_add(1, std::memory_order_relaxed);
    if (devices != nullptr) devices->obey(id);
    pending.store(id, std::memory_order_release);
    // The first push does not wait for the thread.
    if (auto* const ready = ready_supplier.load(std::memory_order_acquire)) {
      static_cast<void>(push(*ready, id));
    }
  }

  void repeat_request() noexcept {
    std::uint64_t id = pending.load(std::memory_order_acquire);
    if (id == kNoRequest || supplier == nullptr) return;
    const MonotonicTime now = rt::now();
    if (std::exchange(repeated, id) != id) repeat_until = kNever;
    if (now >= repeat_until) {
      pending.compare_exchange_strong(id, kNoRequest, std::memory_order_acq_rel);
      return;
    }
    if (push(*supplier, id) && repeat_until == kNever) repeat_until = now + config.repeat_for;
  }

  void remind() noexcept {
    if (devices == nullptr || supplier == nullptr || rt::now() < remind_at) return;
    const std::uint64_t id = devices->obeyed();
    if (id == kNoRequest || !push(*supplier, id)) return;
    remind_at = rt::now() + config.remind;
  }

  static bool push(events::Supplier& to, std::uint64_t id) noexcept {
    const device::StopAll stop{id};
    return to
        .push({.type = Event::kType,
               .source = kStopAllSource,
               .schema_id = Event::kSchemaId,
               .payload = rpc::struct_bytes(stop)})
        .has_value();
  }

  void obey(std::uint64_t id) noexcept {
    if (devices->obey(id)) stop_count.fetch_add(1, std::memory_order_relaxed);
  }

  /// Whether this is a replayed request that no program repeats any more.
  [[nodiscard]] bool is_over(const events::EventHeader& header) const noexcept {
    return header.is_replayed && header.hub_sent - header.hub_received > 3 * config.remind;
  }

  void on_events(std::span<const events::EventView> events) override {
    for (const events::EventView& event : events) {
      if (event.header.type != Event::kType || event.payload.size() != sizeof(device::StopAll) ||
          is_over(event.header)) {
        continue;
      }
      obey(rpc::view_struct<device::StopAll>(event.payload).id());
    }
  }

  rpc::Node& node;
  SystemStopDevices* devices;
  SystemStopConfig config;
  std::atomic<bool> is_stopping{false};
  std::atomic<bool> is_subscribed{false};
  std::atomic<std::uint64_t> pending{kNoRequest};
  std::atomic<std::uint64_t> stop_count{0};
  std::atomic<events::Supplier*> ready_supplier{nullptr};
  // Used by this object's thread only.
  std::unique_ptr<events::Supplier> supplier{};
  std::unique_ptr<events::Consumer> consumer{};
  MonotonicTime retry_at{};
  MonotonicTime remind_at{};
  std::uint64_t repeated = kNoRequest;
  MonotonicTime repeat_until = kNever;
  rt::Thread thread{};
};

expected<std::unique_ptr<SystemStop>, SetupError> SystemStop::start(
    rpc::Node& node, SystemStopDevices* devices, const SystemStopConfig& config) {
  auto impl = std::make_unique<Impl>(node, devices, config);
  auto thread = rt::Thread::start({.name = "system-stop", .realtime = rt::RealtimeMode::kOff},
                                  [impl = impl.get()] { impl->run(); });
  if (!thread) return unexpected{std::move(thread.error())};
  impl->thread = std::move(*thread);
  return std::unique_ptr<SystemStop>(new SystemStop(std::move(impl)));
}

SystemStop::SystemStop(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}

SystemStop::~SystemStop() {
  impl_->is_stopping.store(true, std::memory_order_relaxed);
  impl_->thread.join();
}

void SystemStop::request() noexcept {
  impl_->request();
}
bool SystemStop::is_subscribed() const noexcept {
  return impl_->is_subscribed.load(std::memory_order_relaxed);
}
std::uint64_t SystemStop::stop_count() const noexcept {
  return impl_->stop_count.load(std::memory_order_relaxed);
}

}  // namespace rtpm::gvd
