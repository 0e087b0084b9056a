#include "events.hpp"

#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <memory>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "binding.hpp"
#include "errors.hpp"
#include "event_types.hpp"
#include "rtpm/events/hub_types.hpp"
#include "rtpm/events/supplier.hpp"
#include "rtpm/rt/clock.hpp"
#include "schema.hpp"
#include "subscription.hpp"
#include "waiting.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace rtpm::python {
namespace {

using SharedSubscription = std::shared_ptr<Subscription>;
/// A schema, and the index of an event of it.
using EventOf = std::pair<nb::object, std::size_t>;

std::unique_ptr<EventTypeOf> type_of(const EventOf& event) {
  return event_type_of(nb::cast<Schema&>(event.first).codec().model(), event.second);
}

/// Type, field and threshold of a deadband.
using DeadbandOf = std::tuple<events::EventType, std::string, double>;

SharedSubscription subscribe(const SharedNode& node, std::string hub, std::string filter,
                             const std::vector<EventOf>& types, std::uint32_t queue,
                             bool keeps_latest, std::uint32_t every_nth, double interval,
                             bool is_interval_per_source, std::vector<DeadbandOf> deadbands,
                             std::uint32_t replay, int priority, bool multicast) {
  const auto settings = std::make_shared<SubscriptionSettings>();
  settings->hub = std::move(hub);
  settings->filter = std::move(filter);
  settings->queue_capacity = queue;
  settings->keeps_latest = keeps_latest;
  settings->delivery.every_nth = every_nth;
  settings->delivery.interval = *span_of(interval);
  settings->delivery.is_interval_per_source = is_interval_per_source;
  settings->delivery.replay = replay;
  settings->priority = priority_of(priority);
  settings->multicast = multicast;
  for (const EventOf& event : types)
    settings->types.push_back(type_of(event));
  for (auto& [type, field, threshold] : deadbands)
    settings->delivery.deadbands.push_back({type, std::move(field), threshold});
  const auto filter_error = std::make_shared<std::string>();
  using Opened = expected<SharedSubscription, SetupError>;
  auto opened = value_of(interruptible<Opened>([node, settings, filter_error] {
    return Subscription::open(node, std::move(*settings), *filter_error);
  }));
  if (opened == nullptr) raise_value_error(*filter_error);
  return opened;
}

void log(const std::vector<std::string>& notices) {
  if (notices.empty()) return;
  const RunsPython scope;
  const nb::object logger = nb::module_::import_("logging").attr("getLogger")("rtpm");
  for (const std::string& notice : notices)
    logger.attr("warning")("%s", notice);
}

/// Whether peek() has an event. Writes the notices to the log.
/// @errors raises StopIteration after close(), or Error if the subscription has ended
bool has_event(Subscription& self) {
  if (!self.needs_attention()) return self.peek().has_value();
  log(self.take_notices());
  if (self.is_closed()) raise_stop_iteration();
  if (self.peek()) return true;
  if (const std::string reason = self.end_reason(); !reason.empty()) {
    raise(SetupError{.what = reason, .remedy = "subscribe again"});
  }
  return false;
}

/// Waits until peek() has an event.
/// @errors those of has_event(), and Timeout
void await_event(Subscription& self, std::optional<double> timeout) {
  if (has_event(self)) return;
  const auto span = span_of(timeout);
  const MonotonicTime end = span ? deadline_after(*span, rt::now()) : kNever;
  while (!has_event(self)) {
    if (rt::now() >= end) raise(rpc::CallError::kTimeout, "next", self.hub());
    wait_in_slices([&] {
      return self.wait(std::min<Duration>(kSlice, std::max(end - rt::now(), Duration{0}))) ||
             rt::now() >= end;
    });
  }
}

nb::tuple to_python(const Subscription& self, const WaitingEvent& event) {
  const events::EventHeader& header = event.header;
  return nb::make_tuple(header.type, header.schema_id, self.host_time_ns(event), header.source,
                        header.sequence, header.priority.value(), header.is_replayed,
                        nb::bytes(event.payload.data(), event.payload.size()),
                        self.uncertainty_ns(event));
}

/// The next delivery: an event, or the list of the events of a conjunction; None if nothing waits.
/// @errors those of has_event()
nb::object try_next(Subscription& self) {
  if (self.needs_attention()) static_cast<void>(has_event(self));
  const std::vector<WaitingEvent> events = self.take();
  if (events.empty()) return nb::none();
  if (events.size() == 1) return to_python(self, events.front());
  nb::list delivery;
  for (const WaitingEvent& event : events)
    delivery.append(to_python(self, event));
  return delivery;
}

nb::object next(Subscription& self, std::optional<double> timeout) {
  while (true) {
    if (nb::object delivery = try_next(self); !delivery.is_none()) return delivery;
    await_event(self, timeout);
  }
}

/// Type, schema and payload size of the next event, and whether more of its delivery follow; None
/// if nothing waits.
/// @errors those of has_event()
nb::object try_peek(Subscription& self) {
  if (!has_event(self)) return nb::none();
  const auto event = self.peek();
  if (!event) return nb::none();
  const auto& [header, size] = *event;
  return nb::make_tuple(header.type, header.schema_id, size, header.is_continued);
}

nb::object peek(Subscription& self, std::optional<double> timeout) {
  while (true) {
    if (nb::object next = try_peek(self); !next.is_none()) return next;
    await_event(self, timeout);
  }
}

/// How many events were lost, in the order of rtpm/events.py's Losses.
nb::tuple losses(const Subscription& self) {
  const MissedEvents missed = self.missed();
  const events::Losses& way = missed.on_the_way;
  return nb::make_tuple(missed.queue_count, missed.memory_count,
                        missed.replaced_count + way.replaced_count, way.overflow_count,
                        way.overrun_count, way.unrepaired_count, way.memory_count,
                        way.too_large_count);
}

/// The next events like the one that peek() described, packed as rtpm/events.py lays them out:
/// time, source, sequence, and at `offset` the payload; and the largest uncertainty of their times.
nb::tuple take_records(Subscription& self, std::size_t count_max, events::EventType type,
                       std::uint64_t schema_id, std::size_t payload_size, std::size_t offset,
                       std::size_t record_size) {
  std::vector<std::byte> bytes;
  std::uint32_t uncertainty_ns = 0;
  {
    const Released released;
    events::EventHeader header{.type = type};
    header.schema_id = schema_id;
    const auto events = self.take_alike(count_max, header, payload_size);
    bytes.resize(events.size() * record_size);
    std::byte* at = bytes.data();
    for (const WaitingEvent& event : events) {
      const std::int64_t time_ns = self.host_time_ns(event);
      uncertainty_ns = std::max(uncertainty_ns, self.uncertainty_ns(event));
      const std::uint64_t source = event.header.source;
      std::memcpy(at, &time_ns, sizeof time_ns);
      std::memcpy(at + 8, &source, sizeof source);
      std::memcpy(at + 16, &event.header.sequence, sizeof event.header.sequence);
      if (payload_size > 0) std::memcpy(at + offset, event.payload.data(), payload_size);
      at += record_size;
    }
  }
  return nb::make_tuple(nb::bytearray(bytes.data(), bytes.size()), uncertainty_ns);
}

/// Number, name, fingerprint and schema of each type that the hub knows.
nb::list types(const SharedSubscription& self) {
  using Known = expected<events::HubTypes, SetupError>;
  const auto known = value_of(interruptible<Known>(
      [self] { return events::HubTypes::ask(self->node()->node, self->hub()); }));
  nb::list list;
  for (const events::EventDescriptor* type : known.list()) {
    list.append(nb::make_tuple(type->type, std::string(type->name), type->schema_id,
                               std::string(type->schema)));
  }
  return list;
}

int file_descriptor(Subscription& self) {
  const int descriptor = self.file_descriptor();
  if (descriptor >= 0) return descriptor;
  PyErr_SetFromErrno(PyExc_OSError);
  raise_python_error();
}

/// A supplier, and what it refers to.
struct OpenSupplier {
  OpenSupplier(SharedNode its_node, std::shared_ptr<const EventTypeOf> its_type)
      : node(std::move(its_node)), type(std::move(its_type)), process(::getpid()) {}
  OpenSupplier(const OpenSupplier&) = delete;
  OpenSupplier& operator=(const OpenSupplier&) = delete;
  ~OpenSupplier() {
    // In a forked child its thread does not exist, so nothing could end it.
    if (::getpid() != process) static_cast<void>(supplier.release());
  }

  SharedNode node;
  std::shared_ptr<const EventTypeOf> type;
  int process;
  std::unique_ptr<events::Supplier> supplier{};
};

/// The struct that an object of the schema consists of on the wire; None if it is a table.
nb::object payload_struct(const Schema& schema, std::size_t object) {
  const auto payload = schema::payload_of(schema.codec().model(), object);
  return payload.struct_index ? schema.codec().class_of(*payload.struct_index) : nb::none();
}

/// Pushes events of one type.
/// @ownership keeps its node and schema
/// @threads   with the GIL
class Supplier {
 public:
  Supplier(const SharedNode& node, EventOf event, std::string hub, int priority)
      : hub_(std::move(hub)),
        type_(type_of(event)),
        schema_(std::move(event.first)),
        payload_(schema::payload_of(codec().model(), event.second)) {
    using Created = expected<std::shared_ptr<OpenSupplier>, SetupError>;
    events::SupplierConfig config{.name = "python", .types = {&type_->descriptor}};
    config.priority = priority_of(priority);
    open_ = value_of(interruptible<Created>([node, type = type_, hub = hub_, config]() -> Created {
      auto open = std::make_shared<OpenSupplier>(node, type);
      auto created = events::Supplier::create(node->node, hub, config);
      if (!created) return unexpected{std::move(created.error())};
      open->supplier = std::move(*created);
      return open;
    }));
  }

  void push(nb::handle value, events::SourceId source, std::optional<std::int64_t> time_ns) {
    const auto bytes = codec().encode(payload_, value);
    events::EventDraft event = draft(bytes, source);
    if (time_ns) event.origin = time_from_ns(*time_ns);
    check([&] { return open_->supplier->push(event); });
  }

  void push_many(nb::handle values, events::SourceId source) {
    const RunsPython scope;
    std::vector<std::vector<std::byte>> payloads;
    for (const nb::handle value : nb::iter(values))
      payloads.push_back(codec().encode(payload_, value));
    check([&]() -> expected<void, rpc::CallError> {
      for (const std::vector<std::byte>& bytes : payloads) {
        if (auto added = open_->supplier->add(draft(bytes, source)); !added) return added;
      }
      return open_->supplier->flush();
    });
  }

  /// Pushes the payloads of `size` bytes that `packed` contains.
  void push_packed(const nb::bytes& packed, std::size_t size, events::SourceId source) {
    const ConstBytes bytes(static_cast<const std::byte*>(packed.data()), packed.size());
    check([&]() -> expected<void, rpc::CallError> {
      for (std::size_t at = 0; at + size <= bytes.size(); at += size) {
        if (auto added = open_->supplier->add(draft(bytes.subspan(at, size), source)); !added) {
          return added;
        }
      }
      return open_->supplier->flush();
    });
  }

 private:
  const Codec& codec() const { return nb::cast<const Schema&>(schema_).codec(); }
  events::EventDraft draft(ConstBytes payload, events::SourceId source) const noexcept {
    return {.type = type_->descriptor.type,
            .source = source,
            .schema_id = type_->descriptor.schema_id,
            .payload = payload,
            .origin = {},
            .hops = {}};
  }
  template <class Function>
  void check(const Function& send) {
    const auto sent = [&] {
      const Released released;
      return send();
    }();
    if (!sent) raise(sent.error(), "push", hub_);
  }

  std::string hub_;
  std::shared_ptr<const EventTypeOf> type_;
  nb::object schema_;
  schema::Payload payload_;
  std::shared_ptr<OpenSupplier> open_{};
};

}  // namespace

void define_events(nb::module_& module) {
  module.def("payload_struct", &payload_struct, "schema"_a, "object"_a);
  nb::class_<Subscription>(module, "Subscription")
      .def(nb::new_(&subscribe), "node"_a, "hub"_a, "filter"_a, "types"_a, "queue"_a,
           "keeps_latest"_a, "every_nth"_a, "interval"_a, "is_interval_per_source"_a, "deadbands"_a,
           "replay"_a, "priority"_a, "multicast"_a)
      .def("next", &next, "timeout"_a.none())
      .def("try_next", &try_next)
      .def("peek", &peek, "timeout"_a.none())
      .def("try_peek", &try_peek)
      .def("take_records", &take_records, "count"_a, "type"_a, "schema_id"_a, "payload_size"_a,
           "offset"_a, "record_size"_a)
      .def("types", &types)
      .def_prop_ro("losses", &losses)
      .def("fileno", &file_descriptor)
      .def("close", [](Subscription& self) {
        {
          const Released released;
          self.close();
        }
        log(self.take_notices(/*is_last=*/true));
      });
  nb::class_<Supplier>(module, "Supplier")
      .def(nb::init<const SharedNode&, EventOf, std::string, int>(), "node"_a, "event"_a, "hub"_a,
           "priority"_a)
      .def("push", &Supplier::push, "value"_a, "source"_a, "time_ns"_a.none())
      .def("push_many", &Supplier::push_many, "values"_a, "source"_a)
      .def("push_packed", &Supplier::push_packed, "packed"_a, "size"_a, "source"_a);
}

}  // namespace rtpm::python
