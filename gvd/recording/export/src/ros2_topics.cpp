#include "ros2_topics.hpp"

namespace rtpm::exports {
namespace {

/// The publisher's QoS, as rosbag2 writes it into a channel's metadata up to its version 8; later
/// ones read it, too. Numbers are those of rmw/types.h.
std::string qos_text(Durability durability) {
  const bool is_latched = durability == Durability::kTransientLocal;
  const std::string forever = "    sec: 9223372036\n    nsec: 854775807\n";
  return std::string("- history: 1\n") +                                          // Keep last.
         "  depth: " + (is_latched ? "1" : "10") + "\n" + "  reliability: 1\n" +  // Reliable.
         "  durability: " + (is_latched ? "1" : "2") + "\n" + "  deadline:\n" + forever +
         "  lifespan:\n" + forever + "  liveliness: 1\n" +  // Automatic.
         "  liveliness_lease_duration:\n" + forever + "  avoid_ros_namespace_conventions: false\n";
}

}  // namespace

expected<std::uint16_t, std::string> Ros2Topics::add(const std::string& name,
                                                     const std::string& origin,
                                                     Durability durability,
                                                     const recording::Schema& schema,
                                                     const std::string& type_hash) {
  if (const auto known = topics_.find(name); known != topics_.end()) {
    if (known->second.origin == origin) return known->second.channel;
    return unexpected{"its name in ROS 2, '" + name + "', is already that of " +
                      known->second.origin};
  }
  const auto schema_id = writer_.add_schema(schema);
  if (!schema_id) return unexpected{schema_id.error().reason()};
  const auto channel =
      writer_.add_channel({.schema_id = *schema_id,
                           .topic = name,
                           .message_encoding = "cdr",
                           .metadata = {{"offered_qos_profiles", qos_text(durability)},
                                        {"topic_type_hash", type_hash}}});
  if (!channel) return unexpected{channel.error().reason()};
  topics_[name] = {origin, *channel};
  return *channel;
}

}  // namespace rtpm::exports
