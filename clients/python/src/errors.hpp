#pragma once

#include <nanobind/nanobind.h>

#include <string_view>
#include <utility>

#include "rtpm/base/expected.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/rpc/error.hpp"

/// RTPM's errors as Python's exceptions, which rtpm/errors.py defines. All need the GIL.
namespace rtpm::python {

/// Raises the exception of a failed set-up: that of the call's error if one caused it.
[[noreturn]] void raise(const SetupError& error);

/// The exception of a failed call. Call it on the thread of the call, before its next one:
/// see rpc::describe().
[[nodiscard]] nanobind::object exception_of(rpc::CallError error, std::string_view method,
                                            std::string_view target);
/// Raises it.
[[noreturn]] void raise(rpc::CallError error, std::string_view method, std::string_view target);

/// Raises this exception.
[[noreturn]] void raise_object(const nanobind::object& exception);
/// Raises the exception that a function of Python has set.
[[noreturn]] void raise_python_error();
[[noreturn]] void raise_stop_iteration();

/// Raises a TypeError or ValueError with this text.
[[noreturn]] void raise_type_error(const std::string& text);
[[noreturn]] void raise_value_error(const std::string& text);

/// The value; raises the exception of its error.
template <class T>
T value_of(expected<T, SetupError> result) {
  if (!result) raise(result.error());
  return *std::move(result);
}
inline void value_of(const expected<void, SetupError>& result) {
  if (!result) raise(result.error());
}

}  // namespace rtpm::python
