#include "store.hpp"

#include <algorithm>

#include "name.hpp"
#include "properties.hpp"

namespace rtpm::names {
namespace {

unexpected<Refusal> refuse(Outcome outcome, std::size_t component = 0,
                           const Record* holder = nullptr) {
  return unexpected<Refusal>{{outcome, static_cast<std::uint8_t>(component), holder}};
}

// As rpc::CallerHost has it.
constexpr std::uint32_t kOwnHost = 0x7f00'0001;
constexpr bool is_own_host(std::uint32_t host) noexcept {
  return host >> 24 == 127;
}

std::size_t last_component(std::string_view name) {
  return static_cast<std::size_t>(std::count(name.begin(), name.end(), '/'));
}

/// Whether `owner` holds the record. A later start may unbind an earlier one's name, but must bind
/// before it renews.
expected<void, Refusal> check_owner(const Record& record, Owner owner, bool may_be_later) {
  const std::size_t last = last_component(record.name);
  if (record.owner.id != owner.id) return refuse(Outcome::kNotOwner, last, &record);
  if (owner.epoch < record.owner.epoch) return refuse(Outcome::kStaleEpoch, last, &record);
  if (owner.epoch > record.owner.epoch && !may_be_later) {
    return refuse(Outcome::kNotOwner, last, &record);
  }
  return {};
}

}  // namespace

Store::Store(Limits limits, std::uint64_t first_revision, Storage* storage)
    : limits_(limits),
      next_revision_(first_revision),
      log_(limits.history_count_max, limits.history_byte_max, first_revision - 1),
      storage_(storage) {}

void Store::restore(std::vector<StoredName> names, MonotonicTime now) {
  for (StoredName& stored : names) {
    const Duration lease = std::min(stored.lease, limits_.first_lease_max);
    insert({.name = std::move(stored.name),
            .url = std::move(stored.url),
            .interface = std::move(stored.interface),
            .owner = stored.owner,
            .expires = stored.is_permanent() ? kNever : now + lease,
            .revision = stored.revision,
            .bound = now,
            .host = stored.host,
            .properties = std::move(stored.properties),
            .change = stored.change,
            .lease = stored.lease});
  }
}

expected<Granted, Refusal> Store::bind(const Claim& claim, MonotonicTime now) {
  return bind(claim, /*replaces=*/false, now);
}
expected<Granted, Refusal> Store::rebind(const Claim& claim, MonotonicTime now) {
  return bind(claim, /*replaces=*/true, now);
}

expected<Granted, Refusal> Store::bind(const Claim& from_anywhere, bool replaces,
                                       MonotonicTime now) {
  expire(now);
  Claim claim = from_anywhere;
  // The 16 million loopback addresses are one host.
  if (is_own_host(claim.host)) claim.host = kOwnHost;
  if (auto checked = check_claim(claim); !checked) return unexpected{checked.error()};
  const auto place = records_.find(claim.name);
  if (place == records_.end()) {
    if (auto checked = check_place(claim.name); !checked) return unexpected{checked.error()};
    if (auto checked = check_room(claim, nullptr); !checked) return unexpected{checked.error()};
    return put(claim, place, now);
  }
  if (auto checked = check_holder(claim, place->second, replaces); !checked) {
    return unexpected{checked.error()};
  }
  if (auto checked = check_room(claim, &place->second); !checked) {
    return unexpected{checked.error()};
  }
  return put(claim, place, now);
}

// Whether the claim may take a held name.
expected<void, Refusal> Store::check_holder(const Claim& claim, const Record& held,
                                            bool replaces) const {
  const std::size_t last = last_component(held.name);
  if (held.owner == claim.owner) return {};
  const bool is_same_owner = held.owner.id == claim.owner.id;
  if (is_same_owner && claim.owner.epoch < held.owner.epoch) {
    return refuse(Outcome::kStaleEpoch, last, &held);
  }
  if (is_same_owner && claim.host == held.host) return {};
  if (!replaces) return refuse(Outcome::kAlreadyBound, last, &held);
  if (claim.allows_takeover || claim.holder_revision == held.revision) return {};
  return refuse(claim.holder_revision == 0 ? Outcome::kAlreadyBound : Outcome::kStaleRevision, last,
                &held);
}

expected<void, Refusal> Store::renew(std::string_view name, Owner owner, Duration lease,
                                     MonotonicTime now) {
  expire(now);
  if (lease < limits_.lease_min || lease > limits_.lease_max) return refuse(Outcome::kBadLease);
  const auto place = find(name);
  if (!place) return unexpected{place.error()};
  Record& record = (*place)->second;
  if (auto checked = check_owner(record, owner, /*may_be_later=*/false); !checked) return checked;
  if (record.is_permanent()) return {};
  ends_.erase({record.expires, record.name});
  const bool is_settled = now - record.bound >= limits_.first_lease_max;
  record.expires = now + (is_settled ? lease : std::min(lease, limits_.first_lease_max));
  ends_.emplace(record.expires, record.name);
  return {};
}

expected<const Record*, Refusal> Store::resolve(std::string_view name, MonotonicTime now) {
  expire(now);
  const auto place = find(name);
  if (!place) return unexpected{place.error()};
  return &(*place)->second;
}

expected<void, Refusal> Store::unbind(std::string_view name, Owner owner, MonotonicTime now,
                                      std::uint64_t holder_revision) {
  expire(now);
  const auto place = find(name);
  if (!place) return unexpected{place.error()};
  const Record& record = (*place)->second;
  if (holder_revision == 0) {
    if (auto checked = check_owner(record, owner, /*may_be_later=*/true); !checked) return checked;
  } else if (record.revision != holder_revision) {
    return refuse(Outcome::kStaleRevision, last_component(name), &record);
  }
  auto stored = commit({record.name, nullptr, next_revision_, record.is_permanent()});
  if (stored) drop(*place);
  return stored;
}

expected<Page, Refusal> Store::list(std::string_view directory, std::string_view after,
                                    std::size_t count_max, MonotonicTime now) {
  expire(now);
  for (const std::string_view name : {directory, after}) {
    if (name.empty()) continue;
    if (const auto bad = first_bad_component(name)) return refuse(Outcome::kBadName, *bad);
  }
  // A directory contains the names that begin with it and a '/'; a bound name lists itself.
  std::string prefix(directory);
  const bool is_bound = records_.contains(directory);
  if (!directory.empty() && !is_bound) prefix += '/';
  auto place = after >= prefix ? records_.upper_bound(after) : records_.lower_bound(prefix);
  Page page;
  for (; place != records_.end() && place->first.starts_with(prefix); ++place) {
    if (is_bound && place->first != directory) break;
    if (page.records.size() == count_max) {
      page.is_last = false;
      break;
    }
    page.records.push_back(&place->second);
  }
  return page;
}

void Store::expire(MonotonicTime now) {
  while (!ends_.empty() && ends_.begin()->first <= now) {
    const auto place = records_.find(ends_.begin()->second);
    // A storage that fails does not lengthen a lease. What it still has is leased again after a
    // restart, and ends.
    static_cast<void>(commit({place->first, nullptr, next_revision_, /*is_durable=*/false}));
    drop(place);
  }
}

void Store::drop(Records::iterator place) {
  auto former = std::make_shared<const Record>(place->second);
  erase(place);
  log_.add({next_revision_++, std::move(former), nullptr});
}

void Store::erase(Records::iterator place) {
  const Record& record = place->second;
  ends_.erase({record.expires, record.name});
  index_.remove(record);
  const std::size_t byte_count = names::byte_count(record.properties);
  property_byte_count_ -= byte_count;
  const auto owner = owners_.find(record.owner.id);
  owner->second.property_byte_count -= byte_count;
  if (--owner->second.name_count == 0) owners_.erase(owner);
  const auto host = hosts_.find(record.host);
  const auto count = host->second.count_of_owner.find(record.owner.id);
  if (--count->second == 0) host->second.count_of_owner.erase(count);
  if (--host->second.name_count == 0) hosts_.erase(host);
  records_.erase(place);
}

// `kept`: the present record, if it is of this start of the owner.
Record Store::record_of(const Claim& claim, const Record* kept, MonotonicTime now) const {
  const MonotonicTime bound = kept != nullptr ? kept->bound : now;
  const bool is_settled = now - bound >= limits_.first_lease_max;
  const Duration lease = is_settled ? claim.lease : std::min(claim.lease, limits_.first_lease_max);
  return {.name = std::string(claim.name),
          .url = std::string(claim.url),
          .interface = std::string(claim.interface),
          .owner = claim.owner,
          .expires = claim.is_permanent ? kNever : now + lease,
          .revision = kept != nullptr ? kept->revision : next_revision_,
          .bound = bound,
          .host = claim.host,
          .properties = {claim.properties.begin(), claim.properties.end()},
          .change = next_revision_,
          .lease = claim.is_permanent ? Duration{0} : lease};
}

expected<Granted, Refusal> Store::put(const Claim& claim, Records::iterator held,
                                      MonotonicTime now) {
  std::shared_ptr<const Record> former;
  if (held != records_.end()) former = std::make_shared<const Record>(held->second);
  const bool is_kept = former && former->owner == claim.owner;
  Record next = record_of(claim, is_kept ? former.get() : nullptr, now);
  // A bind that changes nothing but the lease is no change.
  const bool is_same = is_kept && former->url == next.url && former->interface == next.interface &&
                       former->properties == next.properties &&
                       former->is_permanent() == next.is_permanent();
  if (is_same) {
    next.change = former->change;
  } else {
    const StoredName stored{next.name,   next.url,  next.interface, next.owner,     next.revision,
                            next.change, next.host, next.lease,     next.properties};
    const bool is_durable = next.is_permanent() || (former && former->is_permanent());
    if (auto kept = commit({next.name, &stored, next.change, is_durable}); !kept) {
      return unexpected{kept.error()};
    }
    ++next_revision_;
    log_.add({next.change, former, std::make_shared<const Record>(next)});
  }
  const Granted granted{.lease = next.is_permanent() ? Duration::max() : next.lease,
                        .revision = next.revision,
                        .is_takeover = former && former->owner.id != claim.owner.id};
  if (former) erase(held);
  insert(std::move(next));
  return granted;
}

void Store::insert(Record next) {
  std::string name = next.name;
  const auto [place, is_new] = records_.emplace(std::move(name), std::move(next));
  if (!is_new) return;
  const Record& record = place->second;
  ends_.emplace(record.expires, record.name);
  index_.add(record);
  const std::size_t byte_count = names::byte_count(record.properties);
  property_byte_count_ += byte_count;
  OwnerUse& owner = owners_[record.owner.id];
  ++owner.name_count;
  owner.property_byte_count += byte_count;
  Host& host = hosts_[record.host];
  ++host.name_count;
  ++host.count_of_owner[record.owner.id];
}

expected<void, Refusal> Store::commit(const StoredChange& change) {
  if (storage_ == nullptr) return {};
  const auto stored = storage_->commit(change);
  if (stored) return {};
  storage_trouble_ = stored.error().text();
  switch (stored.error().kind) {
    case StorageError::Kind::kFull:
      return refuse(Outcome::kStorageFull);
    case StorageError::Kind::kReadOnly:
      return refuse(Outcome::kReadOnly);
    case StorageError::Kind::kFailed:
      break;
  }
  return refuse(Outcome::kNotStored);
}

expected<void, Refusal> Store::check_claim(const Claim& claim) const {
  if (const auto bad = first_bad_component(claim.name)) return refuse(Outcome::kBadName, *bad);
  if (!is_url(claim.url)) return refuse(Outcome::kBadUrl);
  if (!is_interface(claim.interface)) return refuse(Outcome::kBadInterface);
  if (claim.owner.id == 0) return refuse(Outcome::kBadOwner);
  const bool is_lease = claim.lease >= limits_.lease_min && claim.lease <= limits_.lease_max;
  if (!claim.is_permanent && !is_lease) return refuse(Outcome::kBadLease);
  if (const auto bad = first_bad_property(claim.properties)) {
    return refuse(Outcome::kBadProperty, *bad);
  }
  if (byte_count(claim.properties) > limits_.property_byte_max) {
    return refuse(Outcome::kBadProperty, claim.properties.size() - 1);
  }
  return {};
}

expected<void, Refusal> Store::check_place(std::string_view name) const {
  std::size_t component = 0;
  for (std::size_t end = name.find('/'); end != std::string_view::npos;
       end = name.find('/', end + 1), ++component) {
    if (records_.contains(name.substr(0, end))) return refuse(Outcome::kNotADirectory, component);
  }
  if (is_directory(name)) return refuse(Outcome::kIsADirectory, component);
  return {};
}

// Checks limits, without `held`, the record to be replaced, if not null.
expected<void, Refusal> Store::check_room(const Claim& claim, const Record* held) const {
  if (held == nullptr && records_.size() >= limits_.name_count_max) return refuse(Outcome::kFull);
  const auto owner = owners_.find(claim.owner.id);
  const bool is_more = held == nullptr || held->owner.id != claim.owner.id;
  if (is_more && owner != owners_.end() &&
      owner->second.name_count >= limits_.name_count_per_owner_max) {
    return refuse(Outcome::kOwnerFull);
  }
  if (auto checked = check_properties(claim, held); !checked) return checked;
  return check_host(claim, held);
}

expected<void, Refusal> Store::check_properties(const Claim& claim, const Record* held) const {
  const std::size_t wanted = byte_count(claim.properties);
  const std::size_t freed = held == nullptr ? 0 : byte_count(held->properties);
  // Fewer than before are never too many.
  const bool is_own = held != nullptr && held->owner.id == claim.owner.id;
  if (wanted == 0 || (is_own && wanted <= freed)) return {};
  const auto owner = owners_.find(claim.owner.id);
  const std::size_t owned = owner == owners_.end() ? 0 : owner->second.property_byte_count;
  if (owned - (is_own ? freed : 0) + wanted > limits_.property_byte_per_owner_max) {
    return refuse(Outcome::kOwnerPropertiesFull);
  }
  if (property_byte_count_ - freed + wanted > limits_.property_byte_in_all_max) {
    return refuse(Outcome::kPropertiesFull);
  }
  return {};
}

expected<void, Refusal> Store::check_host(const Claim& claim, const Record* held) const {
  const auto found = hosts_.find(claim.host);
  if (found == hosts_.end()) return {};
  const Host& host = found->second;
  const bool is_own = is_own_host(claim.host);
  const bool is_more = held == nullptr || held->host != claim.host;
  if (is_more && host.name_count >=
                     (is_own ? limits_.name_count_own_host_max : limits_.name_count_per_host_max)) {
    return refuse(Outcome::kHostFull);
  }
  if (!host.count_of_owner.contains(claim.owner.id) &&
      host.count_of_owner.size() >=
          (is_own ? limits_.owner_count_own_host_max : limits_.owner_count_per_host_max)) {
    return refuse(Outcome::kHostOwnersFull);
  }
  return {};
}

std::vector<Store::HostUse> Store::hosts(std::size_t count_max) const {
  std::vector<HostUse> uses;
  for (const auto& [host, use] : hosts_)
    uses.push_back({host, use.name_count, use.count_of_owner.size()});
  std::ranges::sort(uses, [](const HostUse& a, const HostUse& b) {
    return a.name_count != b.name_count ? a.name_count > b.name_count : a.host < b.host;
  });
  uses.resize(std::min(uses.size(), count_max));
  return uses;
}

expected<Store::Records::iterator, Refusal> Store::find(std::string_view name) {
  if (const auto bad = first_bad_component(name)) return refuse(Outcome::kBadName, *bad);
  const auto place = records_.find(name);
  if (place != records_.end()) return place;
  return unexpected{missing(name)};
}

bool Store::is_directory(std::string_view name) const {
  const std::string prefix = std::string(name) + '/';
  const auto below = records_.lower_bound(prefix);
  return below != records_.end() && below->first.starts_with(prefix);
}

Refusal Store::missing(std::string_view name) const {
  std::size_t component = 0;
  for (std::size_t end = name.find('/'); end != std::string_view::npos;
       end = name.find('/', end + 1), ++component) {
    const std::string_view place = name.substr(0, end);
    if (records_.contains(place)) return refuse(Outcome::kNotADirectory, component).error;
    if (!is_directory(place)) return refuse(Outcome::kNotFound, component).error;
  }
  return refuse(is_directory(name) ? Outcome::kIsADirectory : Outcome::kNotFound, component).error;
}

}  // namespace rtpm::names
