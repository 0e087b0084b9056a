#include "errors.hpp"

#include <nanobind/stl/string.h>

#include <array>
#include <cstddef>
#include <string>

#include "waiting.hpp"

namespace nb = nanobind;

namespace rtpm::python {
namespace {

/// The names of CallError's values in rtpm/errors.py, in their order.
constexpr std::array<const char*, 25> kNames{
    "Timeout",       "Expired",      "Overload",           "NoChannel",      "Disconnected",
    "PeerRestarted", "Unreachable",  "NoResources",        "Refused",        "VersionUnsupported",
    "NoSuchMethod",  "NoSuchObject", "BadRequest",         "NotLeaseHolder", "ServantFailed",
    "TooLarge",      "WrongBand",    "PriorityNotAllowed", "BadReply",       "Cancelled",
    "Stopped",       "MaybeLost",    "WrongInterface",     "StreamLost",     "NotAllowed"};
static_assert(kNames.size() == static_cast<std::size_t>(rpc::CallError::kNotAllowed) + 1);

const char* name_of(rpc::CallError error) noexcept {
  return kNames[static_cast<std::size_t>(error)];
}

nb::object errors() {
  return nb::module_::import_("rtpm.errors");
}

}  // namespace

void raise(const SetupError& error) {
  const RunsPython scope;
  const bool is_call =
      error.cause.category() == rpc::make_error_code(rpc::CallError::kTimeout).category();
  // See rpc::make_error_code().
  const char* name = is_call ? name_of(static_cast<rpc::CallError>(error.cause.value() - 1)) : "";
  raise_object(errors().attr("of_setup")(error.what, error.why, error.remedy, name, error.text()));
}

nb::object exception_of(rpc::CallError error, std::string_view method, std::string_view target) {
  const RunsPython scope;
  return errors().attr("of_call")(name_of(error), rpc::describe(error),
                                  nb::str(method.data(), method.size()),
                                  nb::str(target.data(), target.size()));
}

void raise(rpc::CallError error, std::string_view method, std::string_view target) {
  raise_object(exception_of(error, method, target));
}

void raise_object(const nb::object& exception) {
  PyErr_SetObject(exception.type().ptr(), exception.ptr());
  throw nb::python_error();
}

void raise_python_error() {
  throw nb::python_error();
}

void raise_stop_iteration() {
  throw nb::stop_iteration();
}

void raise_type_error(const std::string& text) {
  PyErr_SetString(PyExc_TypeError, text.c_str());
  throw nb::python_error();
}

void raise_value_error(const std::string& text) {
  PyErr_SetString(PyExc_ValueError, text.c_str());
  throw nb::python_error();
}

}  // namespace rtpm::python
