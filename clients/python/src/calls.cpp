#include "calls.hpp"

#include <nanobind/stl/optional.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/unique_ptr.h>

#include <algorithm>
#include <memory>
#include <string>
#include <utility>

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
  /// call's number for cancel().
  rpc::CallNumber begin(nb::object binding, std::size_t index, nb::handle request,
                        std::optional<int> priority, std::optional<double> deadline,
                        const CallScope* scope, nb::object done) {
    auto& bound = nb::cast<Binding&>(binding);
    auto begun = bound.start(index, request, bound.options(index, priority, deadline, scope));
    return completions_->then(std::move(begun), [&bound, keep = std::move(binding), index,
                                                 done = std::move(done)](const auto& reply) {
      try {
        if (reply) {
          done(bound.decode(index, reply->bytes()), nb::none());
        } else {
          done(nb::none(), exception_of(reply.error(), bound.method(index).name, bound.target()));
        }
      } catch (nb::python_error& error) {
        error.discard_as_unraisable("rtpm.AsyncCalls");
      }
    });
  }

 private:
  Unforked<rpc::Completions> completions_{new rpc::Completions};
};

/// What calls inherit within a scope that has a priority or a deadline, inside `outer`.
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
  nb::class_<AsyncCalls>(module, "AsyncCalls")
      .def(nb::init<>())
      .def("fileno", &AsyncCalls::descriptor)
      .def("poll", &AsyncCalls::poll)
      .def("cancel", &AsyncCalls::cancel, "number"_a)
      .def("begin", &AsyncCalls::begin, "binding"_a, "method"_a, "request"_a.none(),
           "priority"_a.none(), "deadline"_a.none(), "scope"_a.none(), "done"_a);
}

}  // namespace rtpm::python
