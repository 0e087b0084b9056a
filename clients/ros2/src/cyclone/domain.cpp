#include "cyclone/domain.hpp"

#include <charconv>
#include <cstdlib>
#include <string_view>

namespace rtpm::ros2 {
namespace {

/// The largest domain whose ports lie below the ports that systems give to clients.
constexpr std::uint32_t kDomainMax = 101;

std::string_view variable(const char* name) {
  const char* const value = std::getenv(name);
  return value == nullptr ? std::string_view() : std::string_view(value);
}

}  // namespace

expected<Domain, SetupError> domain_of_environment() {
  Domain domain;
  if (const std::string_view text = variable("ROS_DOMAIN_ID"); !text.empty()) {
    const char* const end = text.data() + text.size();
    const auto [stop, error] = std::from_chars(text.data(), end, domain.id);
    if (error != std::errc() || stop != end || domain.id > kDomainMax) {
      return setup_error("ROS_DOMAIN_ID is '" + std::string(text) + "'",
                         "a domain is a number from 0 to 101. Set the one of your ROS programs");
    }
  }
  const std::string_view range = variable("ROS_AUTOMATIC_DISCOVERY_RANGE");
  if (range == "LOCALHOST") {
    domain.range = DiscoveryRange::kLocalhost;
  } else if (!range.empty() && range != "SUBNET" && range != "SYSTEM_DEFAULT") {
    return setup_error("ROS_AUTOMATIC_DISCOVERY_RANGE is '" + std::string(range) + "'",
                       "the bridge knows SUBNET and LOCALHOST. For chosen hosts, list them as "
                       "peers in CYCLONEDDS_URI");
  }
  return domain;
}

}  // namespace rtpm::ros2
