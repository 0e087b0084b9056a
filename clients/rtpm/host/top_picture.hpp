#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "cli/context.hpp"
#include "cli/output.hpp"
#include "rtpm/base/histogram.hpp"
#include "rtpm/driver/sample.hpp"
#include "rtpm/gvd/client.hpp"
#include "rtpm/rpc/lane_table.hpp"

namespace rtpm::tool {

/// The key that sorts the lanes, highest first.
enum class SortKey : std::uint8_t { kCalls, kLongest, kDrops, kServer };
[[nodiscard]] std::string_view to_string(SortKey key) noexcept;

/// A lane of a server on this host, with its rates since the previous look.
struct TopLane {
  std::string server{};
  std::string lane{};
  int process_id = 0;
  rpc::LaneSample sample{};
  double calls_per_s = 0;
  double drops_per_s = 0;
};

/// A device that the registry names, with its latest sample.
struct TopDevice {
  std::string name{};
  std::string problem{};  ///< Why it was not read; empty if it was.
  driver::Sample sample{};
  double cycles_per_s = 0;
  LatencyHistogram read_time{};  ///< The durations of all reads so far.
};

/// The contents of `rtpm top`.
struct TopState {
  std::vector<TopLane> lanes{};
  std::vector<TopDevice> devices{};
  std::string registry_problem{};  ///< Why the registry does not answer; empty if it does.
};

/// Polls lanes and devices, and computes the rates.
/// @ownership refers to its context
/// @threads  one
class TopObserver {
 public:
  explicit TopObserver(Context& context) noexcept : context_(context) {}
  [[nodiscard]] TopState look(SortKey key);

 private:
  struct Before {
    MonotonicTime when{};
    std::uint64_t count = 0;
    std::uint64_t drop_count = 0;
  };
  struct Device {
    gvd::DeviceClient client;
    LatencyHistogram read_time{};
    Before before{};
  };
  void look_at_lanes(TopState& state);
  void look_at_devices(TopState& state);
  TopDevice read(const std::string& name);

  Context& context_;
  std::map<std::string, Before> lanes_{};
  std::map<std::string, Device> devices_{};
};

/// The state as lines for users; the first line of each table is its header.
struct TopPicture {
  std::string summary{};
  std::vector<std::string> lanes{};
  std::vector<std::string> devices{};
};
[[nodiscard]] TopPicture picture_of(const TopState& state);
[[nodiscard]] Json json_of(const TopState& state);

}  // namespace rtpm::tool
