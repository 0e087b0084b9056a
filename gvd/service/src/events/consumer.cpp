#include "rtpm/gvd/consumer.hpp"

#include <algorithm>
#include <atomic>
#include <utility>

#include "events/event_wire.hpp"

namespace rtpm::gvd {
namespace {

/// Samples and changes of all `devices`.
events::Filter everything_of(const std::vector<std::string>& devices) {
  std::vector<events::Filter> filters;
  for (const std::string& device : devices) {
    filters.push_back(samples_of(device));
    filters.push_back(changes_of(device));
  }
  return events::any_of(std::move(filters));
}

/// Passes samples on to a sink.
class SinkHandler final : public DeviceEventHandler {
 public:
  explicit SinkHandler(SampleSink& sink) noexcept : sink_(sink) {}
  void on_events(std::span<const DeviceEvent> events) override {
    for (const DeviceEvent& event : events) {
      if (const auto* const sample = std::get_if<driver::Sample>(&event.what)) sink_.push(*sample);
    }
  }

 private:
  SampleSink& sink_;
};

}  // namespace

struct DeviceConsumer::Impl final : events::EventHandler {
  Impl(std::vector<std::string> named, DeviceEventHandler& called)
      : devices(std::move(named)), handler(&called) {}
  Impl(std::vector<std::string> named, std::unique_ptr<SinkHandler> owned)
      : devices(std::move(named)), sink(std::move(owned)), handler(sink.get()) {}

  void on_events(std::span<const events::EventView> events) override {
    read.clear();
    for (const events::EventView& event : events) {
      auto one = read_event(event);
      if (!one) {
        unreadable_count.fetch_add(1, std::memory_order_relaxed);
        continue;
      }
      if (event.header.type != events::kTimeoutType) one->device = name_of(event.header.source);
      read.push_back(std::move(*one));
    }
    if (!read.empty()) handler->on_events(read);
  }
  void on_notice(const events::Notice& notice) override { handler->on_notice(notice); }

  [[nodiscard]] std::string_view name_of(events::SourceId source) const noexcept {
    const auto found = std::ranges::find_if(
        devices, [source](const std::string& name) { return source_of(name) == source; });
    return found == devices.end() ? std::string_view{} : *found;
  }

  expected<void, SetupError> subscribe(rpc::Node& node, DeviceConsumerConfig config) {
    events::ConsumerConfig& subscribed = config.subscription;
    if (subscribed.filter.kind == events::Filter::Kind::kNull) {
      subscribed.filter = everything_of(devices);
    }
    const auto types = device_event_types();
    subscribed.types.insert(subscribed.types.end(), types.begin(), types.end());
    auto made = events::Consumer::create(node, config.hub, std::move(subscribed), *this);
    if (!made) return unexpected{std::move(made.error())};
    consumer = std::move(*made);
    return {};
  }

  std::vector<std::string> devices;
  std::unique_ptr<SinkHandler> sink{};
  DeviceEventHandler* handler;
  std::vector<DeviceEvent> read{};
  std::atomic<std::uint64_t> unreadable_count{0};
  /// Destroyed before the members that its handler uses.
  std::unique_ptr<events::Consumer> consumer{};
};

expected<DeviceConsumer, SetupError> DeviceConsumer::start(rpc::Node& node,
                                                           DeviceConsumerConfig config,
                                                           DeviceEventHandler& handler) {
  if (config.devices.empty() && config.subscription.filter.kind == events::Filter::Kind::kNull) {
    return setup_error("a consumer of devices' events has neither devices nor a filter", "",
                       "name the devices");
  }
  auto impl = std::make_unique<Impl>(config.devices, handler);
  if (auto subscribed = impl->subscribe(node, std::move(config)); !subscribed) {
    return unexpected{std::move(subscribed.error())};
  }
  return DeviceConsumer{std::move(impl)};
}

expected<DeviceConsumer, SetupError> DeviceConsumer::start(rpc::Node& node, std::string_view device,
                                                           DeviceConsumerConfig config,
                                                           SampleSink& sink) {
  config.devices = {std::string(device)};
  config.subscription.filter = samples_of(device);
  auto impl = std::make_unique<Impl>(config.devices, std::make_unique<SinkHandler>(sink));
  if (auto subscribed = impl->subscribe(node, std::move(config)); !subscribed) {
    return unexpected{std::move(subscribed.error())};
  }
  return DeviceConsumer{std::move(impl)};
}

DeviceConsumer::DeviceConsumer(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
DeviceConsumer::DeviceConsumer(DeviceConsumer&&) noexcept = default;
DeviceConsumer& DeviceConsumer::operator=(DeviceConsumer&&) noexcept = default;
DeviceConsumer::~DeviceConsumer() = default;

events::Consumer& DeviceConsumer::subscription() noexcept {
  return *impl_->consumer;
}

std::uint64_t DeviceConsumer::unreadable_count() const noexcept {
  return impl_->unreadable_count.load(std::memory_order_relaxed);
}

}  // namespace rtpm::gvd
