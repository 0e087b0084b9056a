#pragma once

#include <gst/gst.h>

#include <memory>
#include <string>

#include "rtpm/names/defaults.hpp"
#include "rtpm/names/resolver.hpp"
#include "rtpm/rpc/node.hpp"

/// The elements of the plug-in, and what they have in common.
namespace rtpm::camerad {

/// "rtpmsrc": gives the pictures or the sound of a medium, live.
/// @threads  any
[[nodiscard]] GType source_type() noexcept;
/// "rtpmsink": serves pictures or sound as a medium.
[[nodiscard]] GType sink_type() noexcept;

/// The properties of both.
struct Settings {
  std::string medium = "lab/cam0";
  std::string registry{names::kThisHost};
};
enum Property : unsigned { kMedium = 1, kRegistry, kIsSound, kLatency };

/// A node with the names of a registry.
struct Caller {
  explicit Caller(const std::string& registry) : resolver(node, registry) { node.use(resolver); }
  rpc::Node node{{.wait = {.strategy = rt::WaitStrategy::kBlock}}};
  names::RegistryResolver resolver;
};

/// Adds the properties `medium` and `registry` to a class.
void install_settings(GObjectClass& object_class);
/// Sets or gets one of them; false if it is another property.
[[nodiscard]] bool set_setting(Settings& settings, unsigned id, const GValue& value);
[[nodiscard]] bool get_setting(const Settings& settings, unsigned id, GValue& value);

}  // namespace rtpm::camerad
