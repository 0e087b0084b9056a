#pragma once

#include <nanobind/nanobind.h>

namespace rtpm::python {

/// Defines Subscription and Supplier.
void define_events(nanobind::module_& module);

}  // namespace rtpm::python
