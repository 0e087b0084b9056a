#include "server/policy.hpp"

#include <algorithm>
#include <string>
#include <vector>

#include "execution/thread_pool.hpp"
#include "model/object_table.hpp"

namespace rtpm::rpc {
namespace {

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
