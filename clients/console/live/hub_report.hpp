#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "rtpm/base/time.hpp"
#include "rtpm/dynamic/remote_object.hpp"
#include "rtpm/rpc/node.hpp"

namespace rtpm::console {

/// A hub's report on itself.
struct HubReportView {
  std::uint64_t consumer_count = 0;
  double event_per_s = 0;  ///< The rate of all suppliers together.
};

/// Polls a hub for its report.
/// @ownership refers to its node
/// @threads  one
class HubReport {
 public:
  HubReport(rpc::Node& node, std::string registry, std::string hub)
      : node_(node), registry_(std::move(registry)), hub_(std::move(hub)) {}
  [[nodiscard]] HubReportView look();

 private:
  rpc::Node& node_;
  std::string registry_;
  std::string hub_;
  std::unique_ptr<dynamic::RemoteObject> object_{};
  MonotonicTime before_{};
  std::uint64_t taken_count_ = 0;
};

}  // namespace rtpm::console
