#include "node.hpp"

#include <nanobind/stl/optional.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/string_view.h>

#include <cmath>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "errors.hpp"
#include "forking.hpp"
#include "rtpm/dynamic/remote_object.hpp"
#include "waiting.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace rtpm::python {
namespace {

rpc::Transport transport_of(std::string_view name) {
  for (const rpc::Transport transport : {rpc::Transport::kAuto, rpc::Transport::kUdp,
                                         rpc::Transport::kTcp, rpc::Transport::kSharedMemory}) {
    if (rpc::to_string(transport) == name) return transport;
  }
  raise_value_error("transport takes 'auto', 'udp', 'tcp' or 'shm', not '" + std::string(name) +
                    "'");
}

SharedNode make_node(std::string registry, std::string_view transport, std::string key_file,
                     std::string known_servers_file) {
  rpc::NodeConfig config;
  config.transport = transport_of(transport);
  config.security.key_file = std::move(key_file);
  config.security.known_servers_file = std::move(known_servers_file);
  return unforked(std::make_unique<Node>(std::move(registry), std::move(config)));
}

nb::object to_python(const predicate::Item& item) {
  return std::visit([](const auto& value) { return nb::cast(value); }, item);
}

nb::object to_python(const predicate::Value& value) {
  const auto* list = std::get_if<predicate::List>(&value);
  if (list == nullptr) {
    return std::visit(
        [](const auto& plain) -> nb::object {
          if constexpr (std::is_same_v<std::decay_t<decltype(plain)>, predicate::List>) {
            return nb::none();
          } else {
            return nb::cast(plain);
          }
        },
        value);
  }
  nb::list items;
  for (const predicate::Item& item : list->items)
    items.append(to_python(item));
  return items;
}

/// A name's entry as a dict for rtpm/names.py.
nb::dict entry_of(const names::NameEntry& entry) {
  nb::dict properties;
  for (const names::Property& property : entry.properties)
    properties[nb::str(property.name.c_str())] = to_python(property.value);
  nb::dict result;
  result["name"] = entry.name;
  result["url"] = entry.url;
  result["interface"] = entry.interface;
  result["properties"] = properties;
  return result;
}

using Entries = expected<std::vector<names::NameEntry>, SetupError>;

nb::list to_python(Entries found) {
  nb::list entries;
  for (const names::NameEntry& entry : value_of(std::move(found)))
    entries.append(entry_of(entry));
  return entries;
}

nb::list list_names(const SharedNode& self, std::string directory) {
  return to_python(interruptible<Entries>([self, directory = std::move(directory)]() -> Entries {
    auto found = names::Directory(self->node, self->where).list(directory);
    if (!found) return unexpected{SetupError(std::move(found.error()))};
    return *std::move(found);
  }));
}

nb::list find_names(const SharedNode& self, std::string interface, std::string where,
                    std::string prefer) {
  return to_python(interruptible<Entries>([=]() -> Entries {
    auto found = names::Directory(self->node, self->where)
                     .find({.interface = interface, .predicate = where, .preference = prefer});
    if (!found) return unexpected{SetupError(std::move(found.error()))};
    return std::move(found->entries);
  }));
}

std::string url_of(const SharedNode& self, std::string target) {
  return value_of(
      interruptible<expected<std::string, SetupError>>([self, target = std::move(target)] {
        return names::url_of(self->node, self->where, target);
      }));
}

nb::tuple describe(const SharedNode& self, std::string target) {
  using Description = expected<dynamic::Description, SetupError>;
  const auto description =
      value_of(interruptible<Description>([self, target = std::move(target)]() -> Description {
        auto url = names::url_of(self->node, self->where, target);
        if (!url) return unexpected{std::move(url.error())};
        return dynamic::describe(self->node, *url);
      }));
  return nb::make_tuple(description.interface, description.schema);
}

}  // namespace

Node::Node(std::string names_at, rpc::NodeConfig config)
    : where(std::move(names_at)), node(std::move(config)), resolver(node, where) {
  node.use(resolver);
}

std::optional<Duration> span_of(std::optional<double> seconds) {
  if (!seconds) return std::nullopt;
  constexpr double kLongest = 1e9;
  if (!std::isfinite(*seconds) || *seconds < 0 || *seconds > kLongest) {
    raise_value_error("a time takes seconds from 0 to 1e9, not " + std::to_string(*seconds));
  }
  return Duration{static_cast<Duration::rep>(*seconds * 1e9)};
}

void define_node(nb::module_& module) {
  nb::class_<Node>(module, "Node")
      .def(nb::new_(&make_node), "registry"_a, "transport"_a, "key_file"_a, "known_servers_file"_a)
      .def_ro("where", &Node::where)
      .def("names", &list_names, "directory"_a)
      .def("find", &find_names, "interface"_a, "where"_a, "prefer"_a)
      .def("url_of", &url_of, "target"_a)
      .def("describe", &describe, "target"_a);
}

}  // namespace rtpm::python
