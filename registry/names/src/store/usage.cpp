#include "store/usage.hpp"

#include <algorithm>

#include "model/properties.hpp"

namespace rtpm::names {

void Usage::add(const Record& record) {
  const std::size_t bytes = byte_count(record.properties);
  ++name_count_;
  property_byte_count_ += bytes;
  OwnerUse& owner = owners_[record.owner.id];
  ++owner.name_count;
  owner.property_byte_count += bytes;
  Host& host = hosts_[record.host];
  ++host.name_count;
  ++host.count_of_owner[record.owner.id];
}

void Usage::remove(const Record& record) {
  const std::size_t bytes = byte_count(record.properties);
  --name_count_;
  property_byte_count_ -= bytes;
  const auto owner = owners_.find(record.owner.id);
  owner->second.property_byte_count -= bytes;
  if (--owner->second.name_count == 0) owners_.erase(owner);
  const auto host = hosts_.find(record.host);
  const auto count = host->second.count_of_owner.find(record.owner.id);
  if (--count->second == 0) host->second.count_of_owner.erase(count);
  if (--host->second.name_count == 0) hosts_.erase(host);
}

Outcome Usage::check(const Claim& claim, const Record* held) const {
  if (held == nullptr && name_count_ >= limits_.name_count_max) return Outcome::kFull;
  const auto owner = owners_.find(claim.owner.id);
  const bool is_more = held == nullptr || held->owner.id != claim.owner.id;
  if (is_more && owner != owners_.end() &&
      owner->second.name_count >= limits_.name_count_per_owner_max) {
    return Outcome::kOwnerFull;
  }
  const Outcome checked = check_properties(claim, held);
  return checked != Outcome::kDone ? checked : check_host(claim, held);
}

Outcome Usage::check_properties(const Claim& claim, const Record* held) const {
  const std::size_t wanted = byte_count(claim.properties);
  const std::size_t freed = held == nullptr ? 0 : byte_count(held->properties);
  // A lower number than before is always accepted.
  const bool is_own = held != nullptr && held->owner.id == claim.owner.id;
  if (wanted == 0 || (is_own && wanted <= freed)) return Outcome::kDone;
  const auto owner = owners_.find(claim.owner.id);
  const std::size_t owned = owner == owners_.end() ? 0 : owner->second.property_byte_count;
  if (owned - (is_own ? freed : 0) + wanted > limits_.property_byte_per_owner_max) {
    return Outcome::kOwnerPropertiesFull;
  }
  return property_byte_count_ - freed + wanted > limits_.property_byte_in_all_max
             ? Outcome::kPropertiesFull
             : Outcome::kDone;
}

Outcome Usage::check_host(const Claim& claim, const Record* held) const {
  const auto found = hosts_.find(claim.host);
  if (found == hosts_.end()) return Outcome::kDone;
  const Host& host = found->second;
  const bool is_own = is_own_host(claim.host);
  const bool is_more = held == nullptr || held->host != claim.host;
  if (is_more && host.name_count >=
                     (is_own ? limits_.name_count_own_host_max : limits_.name_count_per_host_max)) {
    return Outcome::kHostFull;
  }
  const std::size_t owner_count_max =
      is_own ? limits_.owner_count_own_host_max : limits_.owner_count_per_host_max;
  const bool is_full = !host.count_of_owner.contains(claim.owner.id) &&
                       host.count_of_owner.size() >= owner_count_max;
  return is_full ? Outcome::kHostOwnersFull : Outcome::kDone;
}

std::vector<Usage::HostUse> Usage::hosts(std::size_t count_max) const {
  std::vector<HostUse> uses;
  for (const auto& [host, use] : hosts_)
    uses.push_back({host, use.name_count, use.count_of_owner.size()});
  std::ranges::sort(uses, [](const HostUse& a, const HostUse& b) {
    return a.name_count != b.name_count ? a.name_count > b.name_count : a.host < b.host;
  });
  uses.resize(std::min(uses.size(), count_max));
  return uses;
}

}  // namespace rtpm::names
