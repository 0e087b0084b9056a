#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "rtpm/events/consumer.hpp"
#include "rtpm/events/supplier.hpp"
#include "rtpm/rpc/tables.hpp"

/// Suppliers and consumers of one event type. Generated code names them: `lab::TouchedSupplier` and
/// `lab::TouchedConsumer` for the event `lab.Touched` of a schema. `Event` is the type that rtpmc
/// generates, `lab::TouchedEvent`: its number, schema id, payload and fields.
namespace rtpm::events {

/// Pushes events of one type and source; threads, real-time class and errors are those of Supplier.
template <class Event>
class TypedSupplier {
 public:
  using Payload = typename Event::Payload;

  /// Binds the hub at `target`, a URL or a name.
  /// @realtime set-up only
  /// @errors   those of Supplier::create()
  [[nodiscard]] static expected<TypedSupplier, SetupError> create(rpc::Node& node,
                                                                  const std::string& target,
                                                                  SourceId source = 0,
                                                                  SupplierConfig config = {}) {
    return of(Supplier::create(node, target, with_type(std::move(config))), source);
  }
  /// Creates a supplier for a hub in this program.
  [[nodiscard]] static expected<TypedSupplier, SetupError> create(Hub& hub, SourceId source = 0,
                                                                  SupplierConfig config = {}) {
    return of(Supplier::create(hub, with_type(std::move(config))), source);
  }
  /// Shares a supplier whose SupplierConfig::types contains `Event::kDescriptor`.
  TypedSupplier(std::shared_ptr<Supplier> supplier, SourceId source) noexcept
      : supplier_(std::move(supplier)), source_(source) {}

  /// Pushes one event that happened at `origin`; nullopt means now.
  /// @realtime like Supplier::push()
  /// @errors   those of Supplier::push()
  [[nodiscard]] expected<void, rpc::CallError> push(
      const Payload& payload, std::optional<MonotonicTime> origin = {}) noexcept
      requires(Event::kIsStruct) {
    return supplier_->push(draft(rpc::struct_bytes(payload), origin));
  }
  [[nodiscard]] expected<void, rpc::CallError> push(
      const flatbuffers::FlatBufferBuilder& finished,
      std::optional<MonotonicTime> origin = {}) noexcept requires(!Event::kIsStruct) {
    return supplier_->push(draft(rpc::table_bytes(finished), origin));
  }
  /// Adds one event to the batch for the next flush().
  /// @realtime like Supplier::add()
  /// @errors   those of Supplier::add()
  [[nodiscard]] expected<void, rpc::CallError> add(
      const Payload& payload, std::optional<MonotonicTime> origin = {}) noexcept
      requires(Event::kIsStruct) {
    return supplier_->add(draft(rpc::struct_bytes(payload), origin));
  }
  [[nodiscard]] expected<void, rpc::CallError> add(
      const flatbuffers::FlatBufferBuilder& finished,
      std::optional<MonotonicTime> origin = {}) noexcept requires(!Event::kIsStruct) {
    return supplier_->add(draft(rpc::table_bytes(finished), origin));
  }
  /// Pushes the batch.
  /// @realtime like Supplier::flush()
  /// @errors   those of Supplier::flush()
  [[nodiscard]] expected<void, rpc::CallError> flush() noexcept { return supplier_->flush(); }

  /// The untyped supplier, for example for its counters.
  [[nodiscard]] Supplier& supplier() noexcept { return *supplier_; }

 private:
  [[nodiscard]] static SupplierConfig with_type(SupplierConfig config) {
    config.types.push_back(&Event::kDescriptor);
    return config;
  }
  [[nodiscard]] static expected<TypedSupplier, SetupError> of(
      expected<std::unique_ptr<Supplier>, SetupError> created, SourceId source) {
    if (!created) return unexpected{std::move(created.error())};
    return TypedSupplier(std::move(*created), source);
  }
  [[nodiscard]] EventDraft draft(ConstBytes payload,
                                 std::optional<MonotonicTime> origin) const noexcept {
    return {.type = Event::kType,
            .source = source_,
            .schema_id = Event::kSchemaId,
            .payload = payload,
            .origin = origin};
  }

  std::shared_ptr<Supplier> supplier_;
  SourceId source_;
};

/// Passes the events of one type to a function; see Consumer.
/// @ownership refers to its node, which must outlive it
/// @threads  any
template <class Event>
class TypedConsumer {
 public:
  using Payload = typename Event::Payload;
  /// Receives one event, valid during the call; see EventHandler::on_events().
  using OnEvent = std::function<void(const Payload& payload, const EventHeader& header)>;
  using OnNotice = std::function<void(const Notice& notice)>;

  /// Subscribes to the hub at `target`, a URL or a name: all events of the type, or those that
  /// `config.filter` accepts.
  /// @realtime set-up only
  /// @errors   those of Consumer::create()
  [[nodiscard]] static expected<TypedConsumer, SetupError> create(rpc::Node& node,
                                                                  const std::string& target,
                                                                  OnEvent on_event,
                                                                  ConsumerConfig config = {},
                                                                  OnNotice on_notice = {}) {
    config.types.push_back(&Event::kDescriptor);
    if (config.filter.kind == Filter::Kind::kNull) config.filter = of_type(Event::kType);
    auto handler = std::make_unique<Handler>(std::move(on_event), std::move(on_notice));
    auto consumer = Consumer::create(node, target, std::move(config), *handler);
    if (!consumer) return unexpected{std::move(consumer.error())};
    return TypedConsumer(std::move(handler), std::move(*consumer));
  }

  TypedConsumer(TypedConsumer&&) noexcept = default;
  TypedConsumer& operator=(TypedConsumer&& other) noexcept {
    // A consumer refers to its handler, so both are moved.
    std::swap(handler_, other.handler_);
    std::swap(consumer_, other.consumer_);
    return *this;
  }
  ~TypedConsumer() = default;

  /// The untyped consumer, to change, suspend or end the subscription.
  [[nodiscard]] Consumer& consumer() noexcept { return *consumer_; }
  /// Events omitted because their payload is malformed or of another schema version.
  /// @realtime alloc-free, any thread
  [[nodiscard]] std::uint64_t bad_payload_count() const noexcept {
    return handler_->bad_payload_count.load(std::memory_order_relaxed);
  }

 private:
  struct Handler final : EventHandler {
    Handler(OnEvent event, OnNotice notice)
        : on_event(std::move(event)), on_notice_function(std::move(notice)) {}

    void on_events(std::span<const EventView> events) override {
      for (const EventView& event : events) {
        // A filter may accept other types and timeouts, too.
        if (event.header.type != Event::kType) continue;
        const bool is_known =
            event.header.schema_id == Event::kSchemaId || event.header.schema_id == 0;
        const Payload* const payload = is_known ? read(event.payload) : nullptr;
        if (payload == nullptr) {
          bad_payload_count.fetch_add(1, std::memory_order_relaxed);
        } else {
          on_event(*payload, event.header);
        }
      }
    }
    void on_notice(const Notice& notice) override {
      if (on_notice_function) on_notice_function(notice);
    }
    [[nodiscard]] static const Payload* read(ConstBytes payload) noexcept {
      if constexpr (Event::kIsStruct) {
        if (payload.size() != sizeof(Payload)) return nullptr;
        return &rpc::view_struct<Payload>(payload);
      } else {
        if (!rpc::is_valid_table<Payload>(payload, Event::kLimits)) return nullptr;
        return flatbuffers::GetRoot<Payload>(payload.data());
      }
    }

    OnEvent on_event;
    OnNotice on_notice_function;
    std::atomic<std::uint64_t> bad_payload_count{0};
  };

  TypedConsumer(std::unique_ptr<Handler> handler, std::unique_ptr<Consumer> consumer) noexcept
      : handler_(std::move(handler)), consumer_(std::move(consumer)) {}

  std::unique_ptr<Handler> handler_;
  std::unique_ptr<Consumer> consumer_;  // Destroyed before its handler.
};

}  // namespace rtpm::events
