#pragma once

#include <nanobind/nanobind.h>

namespace rtpm::python {

/// Defines Server and Job: a lane in C++ receives calls and hands them over to Python's workers.
void define_servants(nanobind::module_& module);

}  // namespace rtpm::python
