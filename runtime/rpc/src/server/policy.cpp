#include "server/policy.hpp"

#include <algorithm>
#include <string>
#include <vector>

#include "execution/thread_pool.hpp"
#include "model/object_table.hpp"
#include "rtpm/wire/limits.hpp"

namespace rtpm::rpc {
namespace {

constexpr std::size_t kLaneCountMax = 64;

constexpr std::uint32_t kThreadCountMax = 64;
constexpr std::uint32_t kBufferedRequestMax = 4096;
constexpr std::uint32_t kLocalOnewayMax = 4096;
constexpr std::uint32_t kLargeMessageMax = 1024;
constexpr std::uint32_t kStreamByteMin = 4096;

unexpected<SetupError> out_of_range(const std::string& what, std::uint32_t value, std::uint32_t low,
                                    std::uint32_t high) {
  return setup_error(what + " is " + std::to_string(value), "",
                     "choose " + std::to_string(low) + " to " + std::to_string(high));
}

expected<void, SetupError> check_threads(const LaneConfig& lane, const std::string& low) {
  const std::string name = "of the lane from priority " + low;
  if (lane.static_threads < 1 || lane.static_threads > kThreadCountMax) {
    return out_of_range("static_threads " + name, lane.static_threads, 1, kThreadCountMax);
  }
  if (lane.dynamic_threads > kThreadCountMax) {
    return out_of_range("dynamic_threads " + name, lane.dynamic_threads, 0, kThreadCountMax);
  }
  if (lane.dynamic_idle < Duration{0}) {
    return setup_error("dynamic_idle " + name + " is negative", "", "choose 0 or more");
  }
  if (lane.buffered_request_max > kBufferedRequestMax) {
    return out_of_range("buffered_request_max " + name, lane.buffered_request_max, 0,
                        kBufferedRequestMax);
  }
  return {};
}

constexpr std::size_t kBandCountMax = 16;

expected<void, SetupError> check_bands(const std::string& object, std::vector<Band> bands) {
  if (bands.size() > kBandCountMax) {
    return setup_error(object + " has " + std::to_string(bands.size()) + " bands", "",
                       "have at most " + std::to_string(kBandCountMax));
  }
  std::ranges::sort(bands, {}, &Band::low);
  for (std::size_t i = 0; i < bands.size(); ++i) {
    const bool is_overlapping = i > 0 && bands[i].low <= bands[i - 1].high;
    if (bands[i].low <= bands[i].high && !is_overlapping) continue;
    return setup_error(object + " has a band from " + std::to_string(bands[i].low.value()) +
                           " to " + std::to_string(bands[i].high.value()) +
                           (is_overlapping ? " that overlaps another" : ""),
                       "", "let each band end at or above its begin and before the next");
  }
  return {};
}

}  // namespace

expected<std::vector<LaneConfig>, SetupError> checked_lanes(std::vector<LaneConfig> lanes) {
  if (lanes.empty()) lanes.push_back({});
  if (lanes.size() > kLaneCountMax) {
    return setup_error("a server has at most " + std::to_string(kLaneCountMax) + " lanes", "",
                       "give lanes wider bands");
  }
  std::ranges::sort(lanes, {}, &LaneConfig::low);
  if (lanes.front().low != Priority{0}) {
    return setup_error(
        "no lane serves the priorities below " + std::to_string(lanes.front().low.value()), "",
        "let one lane begin at 0");
  }
  for (std::size_t i = 0; i < lanes.size(); ++i) {
    const std::string low = std::to_string(lanes[i].low.value());
    if (i + 1 < lanes.size() && lanes[i].low == lanes[i + 1].low) {
      return setup_error("two lanes begin at priority " + low, "",
                         "let each lane begin at a priority of its own");
    }
    if (auto checked = check_threads(lanes[i], low); !checked) return unexpected{checked.error()};
    if (lanes[i].name.empty()) lanes[i].name = "lane-" + low;
    lanes[i].priority = std::max(lanes[i].priority, lanes[i].low);
  }
  return lanes;
}

expected<void, SetupError> check_limits(const ServerConfig& config) {
  if (config.message_size_max < wire::kMessageSizeFloor ||
      config.message_size_max > wire::kMessageSizeCeiling) {
    return setup_error("message_size_max is " + std::to_string(config.message_size_max), "",
                       "choose " + std::to_string(wire::kMessageSizeFloor) + " to " +
                           std::to_string(wire::kMessageSizeCeiling) + " bytes");
  }
  if (config.session_count_max < 1 || config.session_count_max > 0xffff) {
    return setup_error("session_count_max is " + std::to_string(config.session_count_max), "",
                       "choose 1 to 65535");
  }
  if (config.large_message_count_max > kLargeMessageMax) {
    return out_of_range("large_message_count_max", config.large_message_count_max, 0,
                        kLargeMessageMax);
  }
  if (config.local_oneway_count_max > kLocalOnewayMax) {
    return out_of_range("local_oneway_count_max", config.local_oneway_count_max, 0,
                        kLocalOnewayMax);
  }
  if (config.stream_byte_max < kStreamByteMin ||
      config.stream_byte_max > wire::kMessageSizeCeiling) {
    return out_of_range("stream_byte_max", config.stream_byte_max, kStreamByteMin,
                        wire::kMessageSizeCeiling);
  }
  return {};
}

expected<void, SetupError> check_policy(std::string_view path, const ObjectOptions& options,
                                        std::span<const LaneConfig> lanes, bool borrows) {
  const std::string object = "object '" + std::string(path) + "'";
  if (options.model == PriorityModel::kNone && lanes.size() > 1) {
    return setup_error(object + " has no priority model, and the server has several lanes",
                       "nothing says in which its methods run",
                       "choose kClientPropagated or kServerDeclared");
  }
  if (options.bands.empty()) return {};
  if (options.model == PriorityModel::kNone) {
    return setup_error(object + " has bands, but no priority model that would use them", "",
                       "choose kClientPropagated or kServerDeclared, or leave the bands out");
  }
  if (auto checked = check_bands(object, options.bands); !checked) return checked;
  if (options.model == PriorityModel::kServerDeclared && !admits(options, options.priority)) {
    return setup_error(object + " declares priority " + std::to_string(options.priority.value()) +
                           ", which is in none of its bands",
                       "", "declare one that is");
  }
  if (lanes.size() == 1 && !ThreadPool::is_wanted(lanes.front(), borrows)) {
    return setup_error(object +
                           " has bands, and the server's only lane serves calls in the order "
                           "in which they come",
                       "",
                       "let the lane keep requests (LaneConfig::buffered_request_max), or give "
                       "each band a lane");
  }
  return {};
}

}  // namespace rtpm::rpc
