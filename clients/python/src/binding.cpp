#include "binding.hpp"

#include <algorithm>
#include <deque>
#include <utility>

#include "errors.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/wire/client_channel.hpp"
#include "stream.hpp"
#include "waiting.hpp"

namespace nb = nanobind;

namespace rtpm::python {
namespace {

/// A call through shared memory usually ends sooner than another Python thread would return the
/// GIL, so its first microseconds are waited for with the GIL.
constexpr Duration kHeldWait = std::chrono::microseconds{10};

/// Calls of call_many() in flight.
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

/// Keeps a Python object alive on a thread without the GIL.
std::shared_ptr<nb::object> kept(const nb::object& object) {
  return {new nb::object(object), [](nb::object* last) {
            if (!nb::is_alive()) return;  // The interpreter has ended, and its objects with it.
            const Return gate;
            const nb::gil_scoped_acquire acquire;
            delete last;
          }};
}

}  // namespace

Priority priority_of(int priority) {
  if (!Priority::is_valid(priority)) {
    raise_value_error("priority takes 0 to 32767, not " + std::to_string(priority));
  }
  return Priority{priority};
}

Binding::Binding(SharedNode node, nb::object schema, std::size_t service, std::string target,
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
  auto bound = interruptible<Bound>(
      [node = node_, keep = kept(schema_object_), &interface = interface_, target = target_,
       options]() -> Bound { return rpc::Binding::bind(node->node, target, interface, options); });
  binding_ = unforked(std::make_unique<rpc::Binding>(value_of(std::move(bound))));
}

rpc::CallOptions options_of(std::optional<int> priority, std::optional<double> deadline) {
  rpc::CallOptions options;
  if (priority) options.priority = priority_of(*priority);
  options.deadline = span_of(deadline);
  return options;
}

rpc::CallOptions Binding::options(std::size_t index, std::optional<int> priority,
                                  std::optional<double> deadline, const CallScope* scope) const {
  rpc::CallOptions options = options_of(priority, deadline);
  if (scope == nullptr) return options;
  options.trace_id = scope->trace_id;
  if (!priority) options.priority = scope->priority;
  if (!deadline && scope->deadline != kNever) {
    const Duration left = std::max(scope->deadline - rt::now(), Duration{0});
    // A stream has no deadline of its own.
    const bool is_whole = scope->replaces_deadlines || method(index).is_stream;
    options.deadline = is_whole ? left : std::min(left, deadline_of(index, {}));
  }
  return options;
}

Duration Binding::deadline_of(std::size_t index, const rpc::CallOptions& options) const {
  if (options.deadline) return *options.deadline;
  const Duration usual = interface_.methods[index].default_deadline;
  return usual > Duration{0} ? usual : node_->node.config().default_deadline;
}

std::vector<std::byte> Binding::encode(std::size_t index, nb::handle request) {
  auto bytes = schema_.codec().encode(method(index).request, request);
  const std::optional<std::uint32_t> size_max = method(index).max_size;
  if (size_max && bytes.size() > *size_max) fail(index, rpc::CallError::kTooLarge);
  return bytes;
}

nb::object Binding::call(std::size_t index, nb::handle request, std::optional<int> priority,
                         std::optional<double> deadline, const CallScope* scope) {
  const auto bytes = encode(index, request);
  const rpc::CallOptions options = this->options(index, priority, deadline, scope);
  if (method(index).oneway) {
    send(index, bytes, options);
    return nb::none();
  }
  auto pending = begin(index, bytes, options);
  return finish(index, pending);
}

nb::list Binding::call_many(std::size_t index, nb::handle requests, std::optional<int> priority,
                            std::optional<double> deadline, const CallScope* scope) {
  const rpc::CallOptions options = this->options(index, priority, deadline, scope);
  const RunsPython runs;
  std::deque<rpc::PendingReply> open;
  nb::list replies;
  const auto take = [&] {
    replies.append(finish(index, open.front()));
    open.pop_front();
  };
  for (const nb::handle request : nb::iter(requests)) {
    const RunsPython step;
    if (open.size() == kWindow) take();
    open.push_back(begin(index, encode(index, request), options));
  }
  while (!open.empty())
    take();
  return replies;
}

std::unique_ptr<Stream> Binding::open_stream(std::size_t index, nb::handle request,
                                             std::optional<int> priority,
                                             std::optional<double> deadline, const CallScope* scope,
                                             std::uint32_t window) {
  if (window < 1 || window > 32) raise_value_error("window takes 1 to 32");
  const auto bytes = encode(index, request);
  const rpc::StreamOptions options{.call = this->options(index, priority, deadline, scope),
                                   .window = window};
  auto reader = [&] {
    const Released released;
    return binding_->open_stream(interface_.methods[index], bytes, options);
  }();
  if (!reader) fail(index, reader.error());
  return std::make_unique<Stream>(nb::find(this), *this, index, std::move(*reader));
}

expected<rpc::PendingReply, rpc::CallError> Binding::start(std::size_t index, ConstBytes request,
                                                           const rpc::CallOptions& options) {
  return binding_->begin(interface_.methods[index], request, options);
}

void Binding::fail(std::size_t index, rpc::CallError error) {
  is_quick_ = false;
  raise(error, method(index).name, target_);
}

std::string Binding::url() const {
  const Released released;
  return binding_->url();
}

std::string_view Binding::transport() const noexcept {
  return rpc::to_string(binding_->transport());
}

nb::tuple Binding::ping(std::optional<double> deadline) {
  const rpc::CallOptions options = options_of({}, deadline);
  const auto clock = [&] {
    const Released released;
    return binding_->ping(options);
  }();
  if (!clock) raise(clock.error(), "ping", target_);
  return nb::make_tuple(static_cast<double>(clock->offset.count()) * 1e-9,
                        static_cast<double>(clock->uncertainty.count()) * 1e-9);
}

rpc::PendingReply Binding::begin(std::size_t index, ConstBytes request,
                                 const rpc::CallOptions& options) {
  const auto start_now = [&] {
    return binding_->begin(interface_.methods[index], request, options);
  };
  // A connection that failed may have to be made again, which takes time.
  auto begun = is_quick_ ? start_now() : [&] {
    const Released released;
    return start_now();
  }();
  if (!begun) fail(index, begun.error());
  return *std::move(begun);
}

nb::object Binding::finish(std::size_t index, rpc::PendingReply& pending) {
  const bool is_held = is_quick_ && binding_->transport() == rpc::Transport::kSharedMemory;
  if (!is_held || !pending.wait(rt::now() + kHeldWait)) {
    wait_in_slices([&] { return pending.wait(rt::now() + kSlice); });
  }
  const auto reply = pending.take();
  if (!reply) fail(index, reply.error());
  is_quick_ = binding_->transport() == rpc::Transport::kSharedMemory;
  return decode(index, reply->bytes());
}

void Binding::send(std::size_t index, ConstBytes request, const rpc::CallOptions& options) {
  const auto delivery = delivery_of(*method(index).oneway);
  const auto sent = [&] {
    const Released released;
    return binding_->send(interface_.methods[index], request, delivery, options);
  }();
  if (!sent) fail(index, sent.error());
}

}  // namespace rtpm::python
