#include "left_out.hpp"

#include "rtpm/capture/channels.hpp"

namespace rtpm::exports {

void LeftOutCounter::add(const std::string& topic, const std::string& reason,
                         std::uint64_t message_count) {
  counts_[{topic, reason}] += message_count;
}

std::vector<LeftOut> LeftOutCounter::all() const {
  std::vector<LeftOut> list;
  for (const auto& [key, count] : counts_)
    list.push_back({key.first, key.second, count});
  return list;
}

std::uint64_t count_of(const recording::FileReader& reader, std::uint16_t channel) {
  const auto& counts = reader.statistics().message_counts;
  const auto found = counts.find(channel);
  return found == counts.end() ? 0 : found->second;
}

bool is_view(const recording::Channel& channel) {
  return capture::value_of(channel, capture::kKindKey) == capture::kViewKind;
}

}  // namespace rtpm::exports
