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

// Loopback addresses, in the form of rpc::CallerHost.
constexpr bool is_own_host(std::uint64_t host) noexcept {
  return host >> 24 == 127;
}

std::size_t last_component(std::string_view name) {
  return static_cast<std::size_t>(std::count(name.begin(), name.end(), '/'));
}

/// Rejects content that another program wrote into a shared storage and that the rules would
/// refuse.
bool is_sound(const StoredName& stored) {
  return !first_bad_component(stored.name) && is_url(stored.url) &&
         is_interface(stored.interface) && stored.owner.id != 0 && stored.lease >= Duration{0} &&
         !first_bad_property(stored.properties);
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
    if (shared_ == nullptr || is_sound(stored)) insert(record_of(std::move(stored), now));
  }
}

void Store::restore_lapsed(std::vector<StoredLapse> lapsed) {
  for (StoredLapse& each : lapsed) {
    if (!is_sound(each.name) || records_.contains(each.name.name)) continue;
    keep_as_lapsed(record_of(std::move(each.name), each.ended), each.ended);
  }
}

void Store::keep_as_lapsed(const Record& record, MonotonicTime ended) {
  const std::string displaced = lapsed_.add({record.name, record.url, record.interface,
                                             record.owner, record.revision, record.host, ended});
  // A storage that fails has the name again after a restart.
  if (!displaced.empty()) {
    static_cast<void>(commit({displaced, nullptr, next_revision_, /*is_durable=*/false}));
  }
}

Record Store::record_of(StoredName stored, MonotonicTime now) const {
  const Duration lease =
      shared_ != nullptr ? stored.lease : std::min(stored.lease, limits_.first_lease_max);
  const Duration stay = shared_ != nullptr ? shared_->stay_of(stored.lease) : lease;
  return {.name = std::move(stored.name),
          .url = std::move(stored.url),
          .interface = std::move(stored.interface),
          .owner = stored.owner,
          .expires = stored.is_permanent() ? kNever : now + stay,
          .revision = stored.revision,
          .bound = now,
          .host = stored.host,
          .properties = std::move(stored.properties),
          .change = stored.change,
          .lease = stored.lease,
          .stay = stay};
}

StoredName stored_name_of(const Record& record) {
  return {record.name,   record.url,  record.interface, record.owner,     record.revision,
          record.change, record.host, record.lease,     record.properties};
}

Granted Plan::granted() const noexcept {
  return {.lease = next.is_permanent() ? Duration::max() : next.lease,
          .revision = next.revision,
          .is_takeover = former && former->owner.id != next.owner.id};
}

expected<Granted, Refusal> Store::bind(const Claim& claim, MonotonicTime now) {
  return bind(claim, /*replaces=*/false, now);
}
expected<Granted, Refusal> Store::rebind(const Claim& claim, MonotonicTime now) {
  return bind(claim, /*replaces=*/true, now);
}

expected<Granted, Refusal> Store::bind(const Claim& claim, bool replaces, MonotonicTime now) {
  auto planned = plan(claim, replaces, now);
  if (!planned) return unexpected{planned.error()};
  return put(std::move(*planned));
}

expected<Plan, Refusal> Store::plan(const Claim& from_anywhere, bool replaces, MonotonicTime now) {
  expire(now);
  Claim claim = from_anywhere;
  claim.host = own_host_as_one(claim.host);
  if (auto checked = check_claim(claim); !checked) return unexpected{checked.error()};
  const auto place = records_.find(claim.name);
  if (place == records_.end()) {
    if (auto checked = check_place(claim.name); !checked) return unexpected{checked.error()};
    if (auto checked = check_room(claim, nullptr); !checked) return unexpected{checked.error()};
    return plan_of(claim, place, now);
  }
  if (auto checked = check_holder(claim, place->second, replaces); !checked) {
    return unexpected{checked.error()};
  }
  if (auto checked = check_room(claim, &place->second); !checked) {
    return unexpected{checked.error()};
  }
  return plan_of(claim, place, now);
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

expected<Plan, Refusal> Store::plan_renewal(std::string_view name, Owner owner, Duration lease,
                                            MonotonicTime now) {
  expire(now);
  if (lease < limits_.lease_min || lease > limits_.lease_max) return refuse(Outcome::kBadLease);
  const auto place = find(name);
  if (!place) return unexpected{place.error()};
  const Record& record = (*place)->second;
  if (auto checked = check_owner(record, owner, /*may_be_later=*/false); !checked) {
    return unexpected{checked.error()};
  }
  Plan plan{.next = record, .former = std::make_shared<const Record>(record), .is_renewal = true};
  if (record.is_permanent()) return plan;
  const bool is_settled = now - record.bound >= limits_.first_lease_max;
  plan.next.lease = is_settled ? lease : std::min(lease, limits_.first_lease_max);
  plan.next.expires = now + plan.next.lease;
  return plan;
}

expected<void, Refusal> Store::renew(std::string_view name, Owner owner, Duration lease,
                                     MonotonicTime now) {
  const auto plan = plan_renewal(name, owner, lease, now);
  if (!plan) return unexpected{plan.error()};
  Record& record = records_.find(name)->second;
  if (record.is_permanent()) return {};
  ends_.erase({record.expires, record.name});
  record.expires = plan->next.expires;
  ends_.emplace(record.expires, record.name);
  return {};
}

void Store::note_renewal(std::string_view name, MonotonicTime now) {
  const auto place = records_.find(name);
  if (place == records_.end() || place->second.is_permanent()) return;
  Record& record = place->second;
  ends_.erase({record.expires, record.name});
  record.expires = now + record.stay;
  ends_.emplace(record.expires, record.name);
}

expected<const Record*, Refusal> Store::resolve(std::string_view name, MonotonicTime now) {
  expire(now);
  const auto place = find(name);
  if (!place) return unexpected{place.error()};
  return &(*place)->second;
}

expected<const Record*, Refusal> Store::plan_unbind(std::string_view name, Owner owner,
                                                    MonotonicTime now,
                                                    std::uint64_t holder_revision) {
  expire(now);
  const auto place = find(name);
  if (!place) return unexpected{place.error()};
  const Record& record = (*place)->second;
  if (holder_revision == 0) {
    if (auto checked = check_owner(record, owner, /*may_be_later=*/true); !checked) {
      return unexpected{checked.error()};
    }
  } else if (record.revision != holder_revision) {
    return refuse(Outcome::kStaleRevision, last_component(name), &record);
  }
  return &record;
}

expected<void, Refusal> Store::unbind(std::string_view name, Owner owner, MonotonicTime now,
                                      std::uint64_t holder_revision) {
  const auto found = plan_unbind(name, owner, now, holder_revision);
  if (!found) {
    const auto dismissed = dismiss(name, owner, holder_revision);
    if (!dismissed) return unexpected{dismissed.error()};
    if (*dismissed) return {};
    return unexpected{found.error()};
  }
  const Record& record = **found;
  const auto stored =
      commit({record.name, nullptr, next_revision_, record.is_permanent(), record.change});
  if (!stored) return unexpected{stored.error()};
  next_revision_ = *stored;
  drop(records_.find(name));
  return {};
}

expected<bool, Refusal> Store::dismiss(std::string_view name, Owner owner,
                                       std::uint64_t holder_revision) {
  if (!lapsed_.may_dismiss(name, owner, holder_revision)) return false;
  const auto stored = commit({name, nullptr, next_revision_, /*is_durable=*/false});
  if (!stored) return unexpected{stored.error()};
  lapsed_.erase(name);
  return true;
}

void Store::share(const SharedStorage& storage, MonotonicTime now) {
  shared_ = &storage;
  current_as_of_ = now;
}

void Store::confirm(MonotonicTime as_of) noexcept {
  current_as_of_ = std::max(current_as_of_, as_of);
  ++confirm_count_;
}

Duration Store::stale_for(MonotonicTime now) const noexcept {
  if (shared_ == nullptr || now - current_as_of_ < kStaleAfter) return {};
  return now - current_as_of_;
}

void Store::apply(std::vector<SharedChange> changes, MonotonicTime now) {
  for (std::size_t i = 0; i < changes.size();) {
    const std::uint64_t revision = changes[i].revision;
    std::size_t end = i + 1;
    while (end < changes.size() && changes[end].revision == revision)
      ++end;
    const bool is_one = end == i + 1;
    for (; i < end; ++i)
      apply(std::move(changes[i]), is_one, now);
    next_revision_ = std::max(next_revision_, revision + 1);
    // Watches resume by revisions: changes with the same revision cannot be reported one by one.
    if (!is_one) log_.restart(revision);
  }
}

void Store::apply(SharedChange change, bool is_logged, MonotonicTime now) {
  const auto place = records_.find(change.name);
  std::shared_ptr<const Record> former;
  if (place != records_.end()) {
    former = std::make_shared<const Record>(place->second);
    erase(place);
  }
  std::shared_ptr<const Record> next;
  if (change.stored && is_sound(*change.stored)) {
    Record record = record_of(std::move(*change.stored), now);
    if (former && former->revision == record.revision) record.bound = former->bound;
    next = std::make_shared<const Record>(record);
    insert(std::move(record));
  } else if (former && !former->is_permanent() && change.has_lapsed) {
    keep_as_lapsed(*former, now);
  }
  const bool is_same = former && next && former->revision == next->revision &&
                       former->url == next->url && former->interface == next->interface &&
                       former->properties == next->properties &&
                       former->is_permanent() == next->is_permanent();
  if (is_logged && !is_same && (former || next)) log_.add({change.revision, former, next});
}

void Store::apply_all(std::vector<StoredName> names, std::uint64_t revision, MonotonicTime now) {
  std::map<std::string, MonotonicTime, std::less<>> since;
  for (const auto& [name, record] : records_)
    since.emplace(name + ' ' + std::to_string(record.revision), record.bound);
  while (!records_.empty())
    erase(records_.begin());
  for (StoredName& stored : names) {
    if (!is_sound(stored)) continue;
    Record record = record_of(std::move(stored), now);
    const auto known = since.find(record.name + ' ' + std::to_string(record.revision));
    if (known != since.end()) record.bound = known->second;
    insert(std::move(record));
  }
  next_revision_ = revision + 1;
  log_.restart(revision);
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
  if (shared_ != nullptr) return;  // The shared storage ends leases.
  while (!ends_.empty() && ends_.begin()->first <= now) {
    const auto place = records_.find(ends_.begin()->second);
    // A storage failure does not extend a lease. A name that the storage still has gets a new lease
    // after a restart, and expires then.
    const Record& record = place->second;
    static_cast<void>(commit({.name = record.name,
                              .revision = next_revision_,
                              .expected = record.change,
                              .lapsed = record.expires}));
    keep_as_lapsed(record, record.expires);
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

// `kept`: the present record, if this start of the owner made it.
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

Plan Store::plan_of(const Claim& claim, Records::iterator held, MonotonicTime now) const {
  Plan plan;
  if (held != records_.end()) plan.former = std::make_shared<const Record>(held->second);
  const Record* const kept =
      plan.former && plan.former->owner == claim.owner ? plan.former.get() : nullptr;
  plan.next = record_of(claim, kept, now);
  // A bind that changes only the lease does not count as a change.
  plan.is_renewal =
      kept != nullptr && kept->url == plan.next.url && kept->interface == plan.next.interface &&
      kept->properties == plan.next.properties && kept->is_permanent() == plan.next.is_permanent();
  plan.is_durable = plan.next.is_permanent() || (plan.former && plan.former->is_permanent());
  if (plan.is_renewal) plan.next.change = kept->change;
  return plan;
}

expected<Granted, Refusal> Store::put(Plan plan) {
  Record& next = plan.next;
  if (!plan.is_renewal) {
    const StoredName stored = stored_name_of(next);
    const auto kept = commit(
        {next.name, &stored, next.change, plan.is_durable, plan.former ? plan.former->change : 0});
    if (!kept) return unexpected{kept.error()};
    next.change = *kept;
    if (!plan.keeps_holder()) next.revision = *kept;
    next_revision_ = *kept + 1;
    log_.add({next.change, plan.former, std::make_shared<const Record>(next)});
  }
  const Granted granted = plan.granted();
  if (plan.former) erase(records_.find(next.name));
  insert(std::move(next));
  return granted;
}

void Store::insert(Record next) {
  std::string name = next.name;
  const auto [place, is_new] = records_.emplace(std::move(name), std::move(next));
  if (!is_new) return;
  const Record& record = place->second;
  lapsed_.erase(record.name);
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

expected<std::uint64_t, Refusal> Store::commit(const StoredChange& change) {
  if (storage_ == nullptr) return change.revision;
  const auto stored = storage_->commit(change);
  if (!stored) return unexpected{refusal_of(stored.error())};
  return *stored;
}

Refusal Store::refusal_of(const StorageError& error) {
  storage_trouble_ = error.text();
  switch (error.kind) {
    case StorageError::Kind::kFull:
      return {Outcome::kStorageFull};
    case StorageError::Kind::kReadOnly:
      return {Outcome::kReadOnly};
    case StorageError::Kind::kUnreachable:
    case StorageError::Kind::kConflict:
      return {Outcome::kStoreUnreachable};
    case StorageError::Kind::kFailed:
      break;
  }
  return {Outcome::kNotStored};
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

// Checks limits, without counting `held`, the record to be replaced, if not null.
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
  // A smaller number than before is never too many.
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
