#include "calls.hpp"

#include <nanobind/stl/optional.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/unique_ptr.h>

#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "errors.hpp"
#include "node.hpp"
#include "rtpm/rpc/async.hpp"
#include "rtpm/rpc/binding.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/wire/client_channel.hpp"
#include "schema.hpp"
#include "waiting.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace rtpm::python {
namespace {

/// A call through shared memory usually ends sooner than another Python thread would return the
/// GIL, so its first microseconds are waited for with the GIL.
constexpr Duration kHeldWait = std::chrono::microseconds{10};

/// Calls of many() in flight.
constexpr std::size_t kWindow = 32;

wire::Delivery delivery_of(schema::OnewayLevel level) noexcept {
  switch (level) {
    case schema::OnewayLevel::kSent:
      return wire::Delivery::kSent;
    case schema::OnewayLevel::kReceived:
      return wire::Delivery::kReceipt;
    case schema::OnewayLevel::kDone:
      break;
  }
  return wire::Delivery::kReply;
}

rpc::CallOptions options_of(std::optional<int> priority, std::optional<double> deadline) {
  rpc::CallOptions options;
  if (priority) {
    if (*priority < 0 || *priority > 32767) {
      raise_value_error("priority takes 0 to 32767, not " + std::to_string(*priority));
    }
    options.priority = Priority{static_cast<std::uint16_t>(*priority)};
  }
  options.deadline = span_of(deadline);
  return options;
}

class Stream;

/// A bound object.
/// @ownership keeps its node and schema
class Binding {
 public:
  Binding(SharedNode node, nb::object schema, std::size_t service, std::string target,
          std::optional<double> deadline)
      : node_(std::move(node)),
        schema_object_(std::move(schema)),
        schema_(nb::cast<Schema&>(schema_object_)),
        service_(schema_.service(service)),
        interface_(schema_.interface(service)),
        target_(std::move(target)) {
    rpc::BindOptions options;
    if (const auto span = span_of(deadline)) options.deadline = *span;
    using Bound = expected<rpc::Binding, SetupError>;
    // The interface lives as long as the schema, which the thread keeps until it ends.
    auto bound =
        interruptible<Bound>([node = node_, keep = kept(schema_object_), &interface = interface_,
                              target = target_, options]() -> Bound {
          return rpc::Binding::bind(node->node, target, interface, options);
        });
    binding_ = std::make_unique<rpc::Binding>(value_of(std::move(bound)));
  }

  nb::object call(std::size_t index, nb::handle request, std::optional<int> priority,
                  std::optional<double> deadline) {
    const schema::Method& method = service_.methods.at(index);
    const auto bytes = schema_.codec().encode(method.request, request);
    const rpc::CallOptions options = options_of(priority, deadline);
    if (method.oneway) return send(index, bytes, options);
    auto pending = begin(index, bytes, options);
    return finish(index, pending);
  }

  /// Calls with each request, several at a time.
  nb::list call_many(std::size_t index, nb::handle requests, std::optional<int> priority,
                     std::optional<double> deadline) {
    const schema::Method& method = service_.methods.at(index);
    const rpc::CallOptions options = options_of(priority, deadline);
    std::deque<rpc::PendingReply> open;
    nb::list replies;
    const auto take = [&] {
      replies.append(finish(index, open.front()));
      open.pop_front();
    };
    for (const nb::handle request : nb::iter(requests)) {
      if (open.size() == kWindow) take();
      open.push_back(begin(index, schema_.codec().encode(method.request, request), options));
    }
    while (!open.empty())
      take();
    return replies;
  }

  std::unique_ptr<Stream> open_stream(std::size_t index, nb::handle request,
                                      std::optional<int> priority, std::optional<double> deadline,
                                      std::uint32_t window);

  std::string url() const {
    const Released released;
    return binding_->url();
  }
  std::string_view transport() const noexcept { return rpc::to_string(binding_->transport()); }
  const std::string& target() const noexcept { return target_; }

  /// The clock offset to the server, and its uncertainty, in seconds.
  nb::tuple ping(std::optional<double> deadline) {
    const rpc::CallOptions options = options_of({}, deadline);
    auto clock = [&] {
      const Released released;
      return binding_->ping(options);
    }();
    if (!clock) raise(clock.error(), "ping", target_);
    return nb::make_tuple(static_cast<double>(clock->offset.count()) * 1e-9,
                          static_cast<double>(clock->uncertainty.count()) * 1e-9);
  }

 private:
  friend class Stream;

  /// Keeps a Python object alive on a thread without the GIL.
  static std::shared_ptr<nb::object> kept(const nb::object& object) {
    return {new nb::object(object), [](nb::object* last) {
              if (!nb::is_alive()) return;  // The interpreter has ended, and its objects with it.
              const nb::gil_scoped_acquire acquire;
              delete last;
            }};
  }

  rpc::PendingReply begin(std::size_t index, ConstBytes request, const rpc::CallOptions& options) {
    // A connection that failed may have to be made again, which takes time.
    auto begun = is_quick_ ? start(index, request, options) : [&] {
      const Released released;
      return start(index, request, options);
    }();
    if (!begun) fail(index, begun.error());
    return *std::move(begun);
  }
  expected<rpc::PendingReply, rpc::CallError> start(std::size_t index, ConstBytes request,
                                                    const rpc::CallOptions& options) {
    return binding_->begin(interface_.methods[index], request, options);
  }

  nb::object finish(std::size_t index, rpc::PendingReply& pending) {
    const bool is_held = is_quick_ && binding_->transport() == rpc::Transport::kSharedMemory;
    if (!is_held || !pending.wait(rt::now() + kHeldWait)) {
      wait_in_slices([&] { return pending.wait(rt::now() + kSlice); });
    }
    const auto reply = pending.take();
    if (!reply) fail(index, reply.error());
    is_quick_ = binding_->transport() == rpc::Transport::kSharedMemory;
    return schema_.codec().decode(service_.methods[index].reply, reply->bytes());
  }

  nb::object send(std::size_t index, ConstBytes request, const rpc::CallOptions& options) {
    const auto delivery = delivery_of(*service_.methods[index].oneway);
    const auto sent = [&] {
      const Released released;
      return binding_->send(interface_.methods[index], request, delivery, options);
    }();
    if (!sent) fail(index, sent.error());
    return nb::none();
  }

  [[noreturn]] void fail(std::size_t index, rpc::CallError error) {
    is_quick_ = false;
    raise(error, service_.methods[index].name, target_);
  }

  SharedNode node_;
  nb::object schema_object_;
  Schema& schema_;
  const schema::Service& service_;
  const rpc::InterfaceDescriptor& interface_;
  std::string target_;
  std::unique_ptr<rpc::Binding> binding_{};
  /// The last call succeeded, through shared memory.
  bool is_quick_ = false;
};

/// The items of a call.
/// @ownership keeps its binding
class Stream {
 public:
  Stream(nb::object owner, Binding& binding, std::size_t index, rpc::ItemReader reader)
      : owner_(std::move(owner)), binding_(binding), index_(index), reader_(std::move(reader)) {}

  /// The next item; raises StopIteration after the last one, Timeout if none arrives in time.
  nb::object next(std::optional<double> timeout) {
    const auto span = span_of(timeout);
    const MonotonicTime end = span ? deadline_after(*span, rt::now()) : kNever;
    expected<std::optional<ConstBytes>, rpc::CallError> item{std::nullopt};
    wait_in_slices([&] {
      item = reader_.next(std::min(end, rt::now() + kSlice));
      return item || item.error() != rpc::CallError::kTimeout || !reader_.is_open() ||
             rt::now() >= end;
    });
    if (!item) binding_.fail(index_, item.error());
    if (!*item) raise_stop_iteration();
    return binding_.schema_.codec().decode(binding_.service_.methods[index_].reply, **item);
  }

  void cancel() {
    const Released released;
    reader_.cancel();
  }

 private:
  nb::object owner_;
  Binding& binding_;
  std::size_t index_;
  rpc::ItemReader reader_;
};

std::unique_ptr<Stream> Binding::open_stream(std::size_t index, nb::handle request,
                                             std::optional<int> priority,
                                             std::optional<double> deadline, std::uint32_t window) {
  if (window < 1 || window > 32) raise_value_error("window takes 1 to 32");
  const schema::Method& method = service_.methods.at(index);
  const auto bytes = schema_.codec().encode(method.request, request);
  rpc::StreamOptions options{.call = options_of(priority, deadline), .window = window};
  auto reader = [&] {
    const Released released;
    return binding_->open_stream(interface_.methods[index], bytes, options);
  }();
  if (!reader) fail(index, reader.error());
  return std::make_unique<Stream>(nb::find(this), *this, index, std::move(*reader));
}

}  // namespace

void define_calls(nb::module_& module) {
  nb::class_<Binding>(module, "Binding")
      .def(nb::init<SharedNode, nb::object, std::size_t, std::string, std::optional<double>>(),
           "node"_a, "schema"_a, "service"_a, "target"_a, "deadline"_a.none())
      .def("call", &Binding::call, "method"_a, "request"_a.none(), "priority"_a.none(),
           "deadline"_a.none())
      .def("call_many", &Binding::call_many, "method"_a, "requests"_a, "priority"_a.none(),
           "deadline"_a.none())
      .def("open_stream", &Binding::open_stream, "method"_a, "request"_a.none(),
           "priority"_a.none(), "deadline"_a.none(), "window"_a)
      .def("ping", &Binding::ping, "deadline"_a.none())
      .def_prop_ro("url", &Binding::url)
      .def_prop_ro("transport", [](const Binding& self) { return std::string(self.transport()); })
      .def_prop_ro("target", &Binding::target);
  nb::class_<Stream>(module, "Stream")
      .def("next", &Stream::next, "timeout"_a.none())
      .def("cancel", &Stream::cancel);
}

}  // namespace rtpm::python
