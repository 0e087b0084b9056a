#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>

#include "rtpm/base/time.hpp"
#include "rtpm/events/hub_report.hpp"
#include "rtpm/rpc/node.hpp"

namespace rtpm::console {

/// The most consumers of a hub that the page shows.
inline constexpr std::size_t kShownConsumerMax = 256;

/// A hub's report on itself.
struct HubReportView {
  std::vector<events::HubConsumer> consumers{};  ///< The slowest first.
  double event_per_s = 0;                        ///< The rate of all suppliers together.
};

/// Polls a hub for its report.
/// @ownership refers to its node
/// @threads  one
class HubReport {
 public:
  HubReport(rpc::Node& node, std::string hub) : node_(node), hub_(std::move(hub)) {}
  [[nodiscard]] HubReportView look();

 private:
  rpc::Node& node_;
  std::string hub_;
  MonotonicTime before_{};
  std::uint64_t taken_count_ = 0;
};

/// The first kShownConsumerMax consumers, for the page.
[[nodiscard]] nlohmann::ordered_json consumers_json(
    const std::vector<events::HubConsumer>& consumers);

}  // namespace rtpm::console
