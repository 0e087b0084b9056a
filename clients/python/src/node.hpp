#pragma once

#include <nanobind/nanobind.h>

#include <memory>
#include <optional>
#include <string>

#include "rtpm/base/time.hpp"
#include "rtpm/names/directory.hpp"
#include "rtpm/names/resolver.hpp"
#include "rtpm/rpc/node.hpp"

namespace rtpm::python {

/// A program's node, with the names that it resolves.
/// @ownership shared by all that uses it
struct Node {
  Node(std::string where, rpc::NodeConfig config);

  std::string where;
  rpc::Node node;
  names::RegistryResolver resolver;
};
using SharedNode = std::shared_ptr<Node>;

/// Seconds as a span; None means none.
/// @errors raises ValueError: not finite, or negative
[[nodiscard]] std::optional<Duration> span_of(std::optional<double> seconds);

void define_node(nanobind::module_& module);

}  // namespace rtpm::python
