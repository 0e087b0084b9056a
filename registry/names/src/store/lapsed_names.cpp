#include "store/lapsed_names.hpp"

#include <algorithm>
#include <utility>

namespace rtpm::names {

std::string LapsedNames::add(LapsedRecord record) {
  const auto is_of_host = [&](const auto& each) { return each.second.host == record.host; };
  const auto of_host = std::ranges::count_if(records_, is_of_host);
  std::string displaced;
  if (records_.contains(record.name)) {
    // It replaces its own entry.
  } else if (static_cast<std::size_t>(of_host) >= kCountPerHostMax) {
    displaced = erase_oldest(is_of_host);
  } else if (records_.size() >= kCountMax) {
    displaced = erase_oldest([](const auto&) { return true; });
  }
  std::string name = record.name;
  records_.insert_or_assign(std::move(name), std::move(record));
  return displaced;
}

template <class Fits>
std::string LapsedNames::erase_oldest(Fits fits) {
  auto oldest = records_.end();
  for (auto each = records_.begin(); each != records_.end(); ++each) {
    if (!fits(*each)) continue;
    if (oldest == records_.end() || each->second.ended < oldest->second.ended) oldest = each;
  }
  if (oldest == records_.end()) return {};
  std::string name = oldest->first;
  records_.erase(oldest);
  return name;
}

void LapsedNames::erase(std::string_view name) {
  const auto found = records_.find(name);
  if (found != records_.end()) records_.erase(found);
}

bool LapsedNames::may_dismiss(std::string_view name, Owner owner,
                              std::uint64_t holder_revision) const {
  const auto found = records_.find(name);
  if (found == records_.end()) return false;
  const LapsedRecord& record = found->second;
  const bool is_owner = holder_revision == 0 && record.owner.id == owner.id;
  return is_owner || record.revision == holder_revision;
}

}  // namespace rtpm::names
