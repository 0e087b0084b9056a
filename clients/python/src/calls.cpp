#include "calls.hpp"

#include <nanobind/stl/optional.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/unique_ptr.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "binding.hpp"
#include "errors.hpp"
#include "rtpm/rpc/completions.hpp"
#include "rtpm/rt/clock.hpp"
#include "stream.hpp"
#include "waiting.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace rtpm::python {
namespace {

bool is_connection_lost(rpc::CallError error) noexcept {
  return error == rpc::CallError::kTimeout || error == rpc::CallError::kDisconnected ||
         error == rpc::CallError::kPeerRestarted || error == rpc::CallError::kUnreachable;
}

/// A call of an event loop that may have to open a channel, for which the loop must not wait.
/// @ownership keeps its binding
class PreparedCall {
 public:
  PreparedCall(nb::object binding, std::size_t index, std::vector<std::byte> request,
               const rpc::CallOptions& options)
      : binding_(std::move(binding)),
        bound_(nb::cast<Binding&>(binding_)),
        index_(index),
        request_(std::move(request)),
        options_(options),
        deadline_(deadline_after(bound_.deadline_of(index, options), rt::now())) {}

  /// Opens the channel and sends the call.
  /// @threads  any, with the GIL
  /// @errors   raises those of Binding::start()
  void start() {
    options_.deadline = std::max(deadline_ - rt::now(), Duration{0});
    {
      const Released released;
      begun_.reset(new Begun(bound_.start(index_, request_, options_)));
    }
    if (!*begun_) fail(begun_->error());
  }
  [[nodiscard]] double seconds_left() const {
    return std::chrono::duration<double>(std::max(deadline_ - rt::now(), Duration{0})).count();
  }
  [[noreturn]] void fail(rpc::CallError error) {
    raise(error, bound_.method(index_).name, bound_.target());
  }

 private:
  friend class AsyncCalls;
  using Begun = expected<rpc::PendingReply, rpc::CallError>;
  nb::object binding_;
  Binding& bound_;
  std::size_t index_;
  std::vector<std::byte> request_;
  rpc::CallOptions options_;
  MonotonicTime deadline_;
  Unforked<Begun> begun_{};
};

/// Calls whose ends an event loop of Python waits for, by one descriptor.
/// @threads   that of the loop, with the GIL
class AsyncCalls {
 public:
  int descriptor() { return value_of(completions_->descriptor()); }
  void poll() {
    const RunsPython scope;
    completions_->poll();
  }
  void cancel(rpc::CallNumber number) { completions_->cancel(number); }

  /// Sends a call; `done` gets the reply and None, or None and the exception, in poll(). Returns the
  /// call's number for cancel(), or a PreparedCall for another thread to start and then for add().
  nb::object begin(nb::object binding, std::size_t index, nb::handle request,
                   std::optional<int> priority, std::optional<double> deadline,
                   const CallScope* scope, nb::object done) {
    auto& bound = nb::cast<Binding&>(binding);
    const rpc::CallOptions options = bound.options(index, priority, deadline, scope);
    auto bytes = bound.encode(index, request);
    const Channels& channels = bound.channels_of(options);
    if (channels.used_count >= channels.open_count) {
      return nb::cast(
          std::make_unique<PreparedCall>(std::move(binding), index, std::move(bytes), options));
    }
    auto begun = bound.start(index, bytes, options);
    return nb::cast(add(std::move(binding), index, options, std::move(begun), std::move(done)));
  }
  rpc::CallNumber add(PreparedCall& call, nb::object done) {
    return add(call.binding_, call.index_, call.options_, std::move(*call.begun_), std::move(done));
  }

 private:
  rpc::CallNumber add(nb::object binding, std::size_t index, const rpc::CallOptions& options,
                      expected<rpc::PendingReply, rpc::CallError> begun, nb::object done) {
    auto& bound = nb::cast<Binding&>(binding);
    Channels& channels = bound.channels_of(options);
    channels.open_count = std::max(channels.open_count, ++channels.used_count);
    return completions_->then(std::move(begun), [&bound, &channels, keep = std::move(binding),
                                                 index, done = std::move(done)](const auto& reply) {
      --channels.used_count;
      try {
        if (reply) {
          done(bound.decode(index, reply->bytes()), nb::none());
          return;
        }
        if (is_connection_lost(reply.error())) channels.open_count = 0;
        done(nb::none(), exception_of(reply.error(), bound.method(index).name, bound.target()));
      } catch (nb::python_error& error) {
        error.discard_as_unraisable("rtpm.AsyncCalls");
      }
    });
  }

  Unforked<rpc::Completions> completions_{new rpc::Completions};
};

/// A scope with a priority, a deadline or a trace, inside `outer`.
std::unique_ptr<CallScope> make_scope(std::optional<int> priority, std::optional<double> seconds,
                                      std::optional<std::uint64_t> trace_id,
                                      const CallScope* outer) {
  auto scope = std::make_unique<CallScope>(outer == nullptr ? CallScope{} : *outer);
  if (priority) scope->priority = priority_of(*priority);
  if (const auto span = span_of(seconds)) {
    scope->deadline = std::min(scope->deadline, deadline_after(*span, rt::now()));
    scope->replaces_deadlines = true;
  }
  if (trace_id) scope->trace_id = *trace_id;
  return scope;
}

}  // namespace

void define_calls(nb::module_& module) {
  nb::class_<CallScope>(module, "CallScope")
      .def(nb::new_(&make_scope), "priority"_a.none(), "seconds"_a.none(), "trace_id"_a.none(),
           "outer"_a.none());
  nb::class_<Binding>(module, "Binding")
      .def(nb::init<SharedNode, nb::object, std::size_t, std::string, std::optional<double>>(),
           "node"_a, "schema"_a, "service"_a, "target"_a, "deadline"_a.none())
      .def("call", &Binding::call, "method"_a, "request"_a.none(), "priority"_a.none(),
           "deadline"_a.none(), "scope"_a.none())
      .def("call_many", &Binding::call_many, "method"_a, "requests"_a, "priority"_a.none(),
           "deadline"_a.none(), "scope"_a.none())
      .def("open_stream", &Binding::open_stream, "method"_a, "request"_a.none(),
           "priority"_a.none(), "deadline"_a.none(), "scope"_a.none(), "window"_a)
      .def("ping", &Binding::ping, "deadline"_a.none())
      .def_prop_ro("url", &Binding::url)
      .def_prop_ro("transport", [](const Binding& self) { return std::string(self.transport()); })
      .def_prop_ro("target", &Binding::target);
  nb::class_<Stream>(module, "Stream")
      .def("next", &Stream::next, "timeout"_a.none())
      .def("try_next", &Stream::try_next)
      .def("cancel", &Stream::cancel);
  nb::class_<PreparedCall>(module, "PreparedCall")
      .def("start", &PreparedCall::start)
      .def_prop_ro("seconds_left", &PreparedCall::seconds_left)
      .def("time_out", [](PreparedCall& self) { self.fail(rpc::CallError::kTimeout); });
  nb::class_<AsyncCalls>(module, "AsyncCalls")
      .def(nb::init<>())
      .def("fileno", &AsyncCalls::descriptor)
      .def("poll", &AsyncCalls::poll)
      .def("cancel", &AsyncCalls::cancel, "number"_a)
      .def("begin", &AsyncCalls::begin, "binding"_a, "method"_a, "request"_a.none(),
           "priority"_a.none(), "deadline"_a.none(), "scope"_a.none(), "done"_a)
      .def("add", nb::overload_cast<PreparedCall&, nb::object>(&AsyncCalls::add), "call"_a,
           "done"_a);
}

}  // namespace rtpm::python
