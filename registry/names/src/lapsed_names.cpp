#include "lapsed_names.hpp"

#include <algorithm>

#include "store.hpp"

namespace rtpm::names {

void LapsedNames::add(const Record& record) {
  const auto is_of_host = [&](const auto& each) { return each.second.host == record.host; };
  const auto of_host = std::ranges::count_if(records_, is_of_host);
  if (static_cast<std::size_t>(of_host) >= kCountPerHostMax) {
    erase_oldest(is_of_host);
  } else if (records_.size() >= kCountMax) {
    erase_oldest([](const auto&) { return true; });
  }
  records_.insert_or_assign(record.name,
                            LapsedRecord{record.name, record.url, record.interface, record.owner,
                                         record.revision, record.host, record.expires});
}

template <class Fits>
void LapsedNames::erase_oldest(Fits fits) {
  auto oldest = records_.end();
  for (auto each = records_.begin(); each != records_.end(); ++each) {
    if (!fits(*each)) continue;
    if (oldest == records_.end() || each->second.ended < oldest->second.ended) oldest = each;
  }
  if (oldest != records_.end()) records_.erase(oldest);
}

void LapsedNames::erase(std::string_view name) {
  const auto found = records_.find(name);
  if (found != records_.end()) records_.erase(found);
}

bool LapsedNames::dismiss(std::string_view name, Owner owner, std::uint64_t holder_revision) {
  const auto found = records_.find(name);
  if (found == records_.end()) return false;
  const LapsedRecord& record = found->second;
  const bool is_owner = holder_revision == 0 && record.owner.id == owner.id;
  if (!is_owner && record.revision != holder_revision) return false;
  records_.erase(found);
  return true;
}

}  // namespace rtpm::names
