#pragma once

#include <nanobind/nanobind.h>

namespace rtpm::python {

/// Defines Binding, Stream and AsyncCalls: calls through the runtime, by the method's index in its service.
void define_calls(nanobind::module_& module);

}  // namespace rtpm::python
