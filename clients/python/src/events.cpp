#include "events.hpp"

#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

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

SharedSubscription subscribe(const SharedNode& node, std::string hub, std::string filter,
                             const std::vector<EventOf>& types, std::uint32_t queue,
                             bool keeps_latest) {
  const auto settings = std::make_shared<SubscriptionSettings>();
  *settings = {std::move(hub), std::move(filter), queue, keeps_latest, {}};
  for (const EventOf& event : types)
    settings->types.push_back(type_of(event));
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
  const nb::object logger = nb::module_::import_("logging").attr("getLogger")("rtpm");
  for (const std::string& notice : notices)
    logger.attr("warning")("%s", notice);
}

/// Waits until peek() has an event.
/// @errors raises StopIteration after close(), Timeout, or Error if the subscription has ended
void await_event(Subscription& self, std::optional<double> timeout) {
  const auto span = span_of(timeout);
  const MonotonicTime end = span ? deadline_after(*span, rt::now()) : kNever;
  while (true) {
    log(self.take_notices());
    if (self.is_closed()) raise_stop_iteration();
    if (self.peek()) return;
    if (const std::string reason = self.end_reason(); !reason.empty()) {
      raise(SetupError{.what = reason, .remedy = "subscribe again"});
    }
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
                        header.sequence, nb::bytes(event.payload.data(), event.payload.size()));
}

/// The events of the next delivery.
nb::list next(Subscription& self, std::optional<double> timeout) {
  nb::list delivery;
  while (nb::len(delivery) == 0) {
    await_event(self, timeout);
    for (const WaitingEvent& event : self.take())
      delivery.append(to_python(self, event));
  }
  return delivery;
}

/// Type, schema and payload size of the next event, and whether more of its delivery follow.
nb::tuple peek(Subscription& self, std::optional<double> timeout) {
  while (true) {
    await_event(self, timeout);
    if (const auto event = self.peek()) {
      const auto& [header, size] = *event;
      return nb::make_tuple(header.type, header.schema_id, size, header.is_continued);
    }
  }
}

/// The next events like the one that peek() described, packed as rtpm/events.py lays them out:
/// time, source, sequence, and at `offset` the payload.
nb::bytearray take_records(Subscription& self, std::size_t count_max, events::EventType type,
                           std::uint64_t schema_id, std::size_t payload_size, std::size_t offset,
                           std::size_t record_size) {
  std::vector<std::byte> bytes;
  {
    const Released released;
    events::EventHeader header{.type = type};
    header.schema_id = schema_id;
    const auto events = self.take_alike(count_max, header, payload_size);
    bytes.resize(events.size() * record_size);
    std::byte* at = bytes.data();
    for (const WaitingEvent& event : events) {
      const std::int64_t time_ns = self.host_time_ns(event);
      const std::uint64_t source = event.header.source;
      std::memcpy(at, &time_ns, sizeof time_ns);
      std::memcpy(at + 8, &source, sizeof source);
      std::memcpy(at + 16, &event.header.sequence, sizeof event.header.sequence);
      if (payload_size > 0) std::memcpy(at + offset, event.payload.data(), payload_size);
      at += record_size;
    }
  }
  return nb::bytearray(bytes.data(), bytes.size());
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
  Supplier(const SharedNode& node, EventOf event, std::string hub)
      : hub_(std::move(hub)),
        type_(type_of(event)),
        schema_(std::move(event.first)),
        payload_(schema::payload_of(codec().model(), event.second)) {
    using Created = expected<std::shared_ptr<OpenSupplier>, SetupError>;
    open_ = value_of(interruptible<Created>([node, type = type_, hub = hub_]() -> Created {
      auto open = std::make_shared<OpenSupplier>(node, type);
      auto created = events::Supplier::create(node->node, hub,
                                              {.name = "python", .types = {&type->descriptor}});
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
           "keeps_latest"_a)
      .def("next", &next, "timeout"_a.none())
      .def("peek", &peek, "timeout"_a.none())
      .def("take_records", &take_records, "count"_a, "type"_a, "schema_id"_a, "payload_size"_a,
           "offset"_a, "record_size"_a)
      .def("types", &types)
      .def_prop_ro("lost_count", &Subscription::lost_count)
      .def("fileno", &file_descriptor)
      .def("close", [](Subscription& self) {
        const Released released;
        self.close();
      });
  nb::class_<Supplier>(module, "Supplier")
      .def(nb::init<const SharedNode&, EventOf, std::string>(), "node"_a, "event"_a, "hub"_a)
      .def("push", &Supplier::push, "value"_a, "source"_a, "time_ns"_a.none())
      .def("push_many", &Supplier::push_many, "values"_a, "source"_a)
      .def("push_packed", &Supplier::push_packed, "packed"_a, "size"_a, "source"_a);
}

}  // namespace rtpm::python
