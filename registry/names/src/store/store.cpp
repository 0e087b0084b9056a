#include "store/store.hpp"

#include <algorithm>

#include "model/name.hpp"
#include "model/properties.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/rt/log.hpp"

namespace rtpm::names {
namespace {

unexpected<Refusal> refuse(Outcome outcome, std::size_t component = 0,
                           const Record* holder = nullptr) {
  return unexpected<Refusal>{
      {outcome, static_cast<std::uint8_t>(component),
       holder == nullptr ? nullptr : std::make_shared<const Record>(*holder)}};
}

std::size_t last_component(std::string_view name) {
  return static_cast<std::size_t>(std::count(name.begin(), name.end(), '/'));
}

/// Rejects content that another program wrote into a storage against the rules.
bool is_sound(const StoredName& stored) {
  return !first_bad_component(stored.name) && is_url(stored.url) &&
         is_interface(stored.interface) && stored.owner.id != 0 && stored.lease >= Duration{0} &&
         !first_bad_property(stored.properties);
}

void leave_out_unsound(std::vector<StoredName>& names) {
  const auto unsound = std::ranges::find_if_not(names, is_sound);
  if (unsound == names.end()) return;
  // One line for all: another program may have stored thousands.
  rt::print_error("rtpm-names",
                  "stored names that break the rules of names are left out, such as '" +
                      printable(unsound->name) + "'");
  std::erase_if(names, [](const StoredName& stored) { return !is_sound(stored); });
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

// Whether the claim may take a held name.
expected<void, Refusal> check_holder(const Claim& claim, const Record& held, bool replaces) {
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

/// Whether the refusal depends on who holds the name, if anyone.
bool is_of_holder(Outcome outcome) noexcept {
  return outcome == Outcome::kNotFound || outcome == Outcome::kAlreadyBound ||
         outcome == Outcome::kStaleEpoch || outcome == Outcome::kNotOwner ||
         outcome == Outcome::kStaleRevision;
}

/// Whether the records differ only in what watches do not see, such as the lease.
bool is_same(const Record& one, const Record& other) {
  return one.revision == other.revision && one.url == other.url &&
         one.interface == other.interface && one.properties == other.properties &&
         one.is_permanent() == other.is_permanent();
}

StoredName stored_name_of(const Record& record) {
  return {record.name,   record.url,  record.interface, record.owner,     record.revision,
          record.change, record.host, record.lease,     record.properties};
}

Storage& memory_only() {
  static Storage storage;
  return storage;
}

}  // namespace

Store::Store(Limits limits, std::uint64_t first_revision, Storage* storage)
    : usage_(limits),
      next_revision_(first_revision),
      log_(limits.history_count_max, limits.history_byte_max, first_revision - 1),
      storage_(storage != nullptr ? *storage : memory_only()) {}

void Store::restore(std::vector<StoredName> names, MonotonicTime now) {
  leave_out_unsound(names);
  for (StoredName& stored : names)
    insert(record_of(std::move(stored), now));
}

void Store::restore_lapsed(std::vector<StoredLapse> lapsed) {
  for (StoredLapse& each : lapsed) {
    if (!is_sound(each.name) || records_.contains(each.name.name)) continue;
    keep_as_lapsed(record_of(std::move(each.name), each.ended), each.ended);
  }
}

// ---- the way of every change ----------------------------------------------------------------

template <class Check>
Store::Checked Store::carry_out(std::string_view name, MonotonicTime now, MonotonicTime deadline,
                                Check check) {
  for (;;) {
    Checked change = check();
    const auto stored = change ? store(*change, deadline) : confirm(name, change.error(), deadline);
    if (stored && change) make(*change, *stored, now);
    if (stored) return change;
    // Checking again only makes sense if the storage has reported the other change.
    const bool is_again =
        stored.error().kind == StorageError::Kind::kConflict && storage_.reports_changes();
    if (!is_again) return unexpected{refusal_of(stored.error())};
  }
}

expected<std::uint64_t, StorageError> Store::store(const Change& change, MonotonicTime deadline) {
  const auto stored = change.next ? std::optional(stored_name_of(*change.next)) : std::nullopt;
  const bool is_durable = (change.next && change.next->is_permanent()) ||
                          (change.former && change.former->is_permanent());
  const StoredChange storing{change.next ? change.next->name : change.former->name,
                             stored ? &*stored : nullptr,
                             next_revision_,
                             is_durable,
                             change.former ? change.former->change : 0,
                             deadline};
  if (!change.is_renewal) return storage_.commit(storing);
  if (auto renewed = storage_.renew(storing); !renewed) return unexpected{renewed.error()};
  return change.former->change;
}

// A registry may lag behind: a change that it would refuse because of a holder may be valid at
// another registry.
expected<std::uint64_t, StorageError> Store::confirm(std::string_view name, const Refusal& refusal,
                                                     MonotonicTime deadline) {
  if (!is_of_holder(refusal.outcome)) return 0;
  const std::uint64_t last = refusal.holder ? refusal.holder->change : 0;
  if (auto same = storage_.confirm(name, last, deadline); !same) return unexpected{same.error()};
  return 0;
}

void Store::make(Change& change, std::uint64_t revision, MonotonicTime now) {
  if (change.is_renewal) return start_lease(*change.next, now);
  if (change.next) change.next->change = revision;
  if (change.next && !change.keeps_holder()) change.next->revision = revision;
  if (storage_.reports_changes()) return;
  put(change.next ? change.next->name : change.former->name, change.next, revision);
}

void Store::start_lease(const Record& renewed, MonotonicTime now) {
  const auto place = records_.find(renewed.name);
  // While the storage waited, another change may have arrived, with its own lease.
  if (place == records_.end() || place->second.change != renewed.change || renewed.is_permanent())
    return;
  Record& record = place->second;
  ends_.erase({record.expires, record.name});
  record.lease = renewed.lease;
  record.expires = now + (record.stay > Duration{0} ? record.stay : record.lease);
  if (record.stay == Duration{0}) ends_.emplace(record.expires, record.name);
}

void Store::put(const std::string& name, std::optional<Record> next, std::uint64_t revision,
                bool is_logged) {
  std::shared_ptr<const Record> before;
  std::shared_ptr<const Record> after;
  if (const auto place = records_.find(name); place != records_.end()) {
    before = std::make_shared<const Record>(place->second);
    erase(place);
  }
  if (next) {
    after = std::make_shared<const Record>(*next);
    insert(std::move(*next));
  }
  next_revision_ = std::max(next_revision_, revision + 1);
  const bool is_seen = before && after ? !is_same(*before, *after) : before || after;
  if (is_logged && is_seen) log_.add({revision, std::move(before), std::move(after)});
}

void Store::insert(Record next) {
  std::string name = next.name;
  const auto [place, is_new] = records_.emplace(std::move(name), std::move(next));
  if (!is_new) return;
  const Record& record = place->second;
  lapsed_.erase(record.name);
  if (record.stay == Duration{0}) ends_.emplace(record.expires, record.name);
  index_.add(record);
  usage_.add(record);
}

void Store::erase(Records::iterator place) {
  const Record& record = place->second;
  ends_.erase({record.expires, record.name});
  index_.remove(record);
  usage_.remove(record);
  records_.erase(place);
}

void Store::expire(MonotonicTime now) {
  while (!ends_.empty() && ends_.begin()->first <= now) {
    const Record record = records_.find(ends_.begin()->second)->second;
    // A storage failure does not extend a lease. A name that the storage still has gets a new lease
    // after a restart, and expires then.
    static_cast<void>(storage_.commit({.name = record.name,
                                       .revision = next_revision_,
                                       .expected = record.change,
                                       .lapsed = record.expires}));
    keep_as_lapsed(record, record.expires);
    put(record.name, std::nullopt, next_revision_);
  }
}

void Store::keep_as_lapsed(const Record& record, MonotonicTime ended) {
  const std::string displaced = lapsed_.add({record.name, record.url, record.interface,
                                             record.owner, record.revision, record.host, ended});
  // After a failure, the storage has the name again after a restart.
  if (!displaced.empty()) static_cast<void>(drop_lapsed(displaced));
}

// A storage that reports changes keeps no lapsed names.
expected<void, StorageError> Store::drop_lapsed(std::string_view name) {
  if (storage_.reports_changes()) return {};
  const auto dropped = storage_.commit({.name = name, .revision = next_revision_});
  if (!dropped) return unexpected{dropped.error()};
  return {};
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

// ---- changes that the storage reports -------------------------------------------------------

void Store::take(std::vector<ReportedChange> changes, MonotonicTime now) {
  for (std::size_t i = 0; i < changes.size(); ++i) {
    ReportedChange& change = changes[i];
    const auto has_its_revision = [&](std::size_t other) {
      return other < changes.size() && changes[other].revision == change.revision;
    };
    const bool is_last = !has_its_revision(i + 1);
    const bool is_one = is_last && !has_its_revision(i - 1);
    const auto held = records_.find(change.name);
    std::optional<Record> next;
    if (change.stored && is_sound(*change.stored)) {
      next = record_of(std::move(*change.stored), now);
      const bool is_kept = held != records_.end() && held->second.revision == next->revision;
      if (is_kept) next->bound = held->second.bound;
    } else if (held != records_.end() && !held->second.is_permanent() && change.has_lapsed) {
      keep_as_lapsed(held->second, now);
    }
    put(change.name, std::move(next), change.revision, is_one);
    // Watches resume by revision, so changes with the same revision cannot be reported
    // individually.
    if (is_last && !is_one) log_.restart(change.revision);
  }
}

void Store::take_all(std::vector<StoredName> names, std::uint64_t revision, MonotonicTime now) {
  std::map<std::string, MonotonicTime, std::less<>> since;
  for (const auto& [name, record] : records_)
    since.emplace(name + ' ' + std::to_string(record.revision), record.bound);
  while (!records_.empty())
    erase(records_.begin());
  leave_out_unsound(names);
  for (StoredName& stored : names) {
    Record record = record_of(std::move(stored), now);
    const auto known = since.find(record.name + ' ' + std::to_string(record.revision));
    if (known != since.end()) record.bound = known->second;
    insert(std::move(record));
  }
  next_revision_ = revision + 1;
  log_.restart(revision);
}

Record Store::record_of(StoredName stored, MonotonicTime now) const {
  const Duration lease =
      stored.stay > Duration{0} ? stored.stay : std::min(stored.lease, limits().first_lease_max);
  return {.name = std::move(stored.name),
          .url = std::move(stored.url),
          .interface = std::move(stored.interface),
          .owner = stored.owner,
          .expires = stored.is_permanent() ? kNever : now + lease,
          .revision = stored.revision,
          .bound = now,
          .host = stored.host,
          .properties = std::move(stored.properties),
          .change = stored.change,
          .lease = stored.lease,
          .stay = stored.stay};
}

// ---- rules ----------------------------------------------------------------------------------

expected<Bound, Refusal> Store::bind(const Claim& claim, bool replaces, MonotonicTime now,
                                     MonotonicTime deadline) {
  const auto change =
      carry_out(claim.name, now, deadline, [&] { return check_bind(claim, replaces, now); });
  if (!change) return unexpected{change.error()};
  const Record& next = *change->next;
  Bound bound{{next.is_permanent() ? Duration::max() : next.lease, next.revision}};
  const bool is_takeover = change->former && change->former->owner.id != next.owner.id;
  if (is_takeover) bound.taken_from = change->former;
  return bound;
}

expected<void, Refusal> Store::renew(std::string_view name, Owner owner, Duration lease,
                                     MonotonicTime now, MonotonicTime deadline) {
  const auto change =
      carry_out(name, now, deadline, [&] { return check_renewal(name, owner, lease, now); });
  if (!change) return unexpected{change.error()};
  return {};
}

expected<void, Refusal> Store::unbind(std::string_view name, Owner owner, MonotonicTime now,
                                      std::uint64_t holder_revision, MonotonicTime deadline) {
  const auto change = carry_out(name, now, deadline,
                                [&] { return check_unbind(name, owner, now, holder_revision); });
  if (change) return {};
  const Outcome outcome = change.error().outcome;
  const bool is_unbound = outcome == Outcome::kNotFound || outcome == Outcome::kNotADirectory ||
                          outcome == Outcome::kIsADirectory;
  if (!is_unbound || !lapsed_.may_dismiss(name, owner, holder_revision)) {
    return unexpected{change.error()};
  }
  if (const auto dropped = drop_lapsed(name); !dropped) {
    return unexpected{refusal_of(dropped.error())};
  }
  lapsed_.erase(name);
  return {};
}

Store::Checked Store::check_bind(const Claim& from_anywhere, bool replaces, MonotonicTime now) {
  expire(now);
  Claim claim = from_anywhere;
  claim.host = own_host_as_one(claim.host);
  if (auto checked = check_claim(claim); !checked) return unexpected{checked.error()};
  const auto place = records_.find(claim.name);
  const Record* const held = place == records_.end() ? nullptr : &place->second;
  auto checked = held == nullptr ? check_place(claim.name) : check_holder(claim, *held, replaces);
  if (!checked) return unexpected{std::move(checked.error())};
  if (const Outcome limit = usage_.check(claim, held); limit != Outcome::kDone) {
    return refuse(limit);
  }
  return change_of(claim, held, now);
}

Store::Checked Store::check_renewal(std::string_view name, Owner owner, Duration lease,
                                    MonotonicTime now) {
  expire(now);
  if (lease < limits().lease_min || lease > limits().lease_max) return refuse(Outcome::kBadLease);
  const auto place = find(name);
  if (!place) return unexpected{place.error()};
  const Record& record = (*place)->second;
  if (auto checked = check_owner(record, owner, /*may_be_later=*/false); !checked) {
    return unexpected{checked.error()};
  }
  Change change{std::make_shared<const Record>(record), record, /*is_renewal=*/true};
  if (record.is_permanent()) return change;
  const bool is_settled = now - record.bound >= limits().first_lease_max;
  change.next->lease = is_settled ? lease : std::min(lease, limits().first_lease_max);
  return change;
}

Store::Checked Store::check_unbind(std::string_view name, Owner owner, MonotonicTime now,
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
  return Change{.former = std::make_shared<const Record>(record)};
}

// `kept`: the current record, if this start of the owner made it.
Record Store::record_of(const Claim& claim, const Record* kept, MonotonicTime now) const {
  const MonotonicTime bound = kept != nullptr ? kept->bound : now;
  const bool is_settled = now - bound >= limits().first_lease_max;
  const Duration lease = is_settled ? claim.lease : std::min(claim.lease, limits().first_lease_max);
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

Store::Change Store::change_of(const Claim& claim, const Record* held, MonotonicTime now) const {
  Change change;
  if (held != nullptr) change.former = std::make_shared<const Record>(*held);
  const bool is_kept = held != nullptr && held->owner == claim.owner;
  change.next = record_of(claim, is_kept ? held : nullptr, now);
  // A bind that only changes the lease does not count as a change.
  change.is_renewal = is_kept && is_same(*held, *change.next);
  if (change.is_renewal) change.next->change = held->change;
  return change;
}

expected<void, Refusal> Store::check_claim(const Claim& claim) const {
  if (const auto bad = first_bad_component(claim.name)) return refuse(Outcome::kBadName, *bad);
  if (!is_url(claim.url)) return refuse(Outcome::kBadUrl);
  if (!is_interface(claim.interface)) return refuse(Outcome::kBadInterface);
  if (claim.owner.id == 0) return refuse(Outcome::kBadOwner);
  const bool is_lease = claim.lease >= limits().lease_min && claim.lease <= limits().lease_max;
  if (!claim.is_permanent && !is_lease) return refuse(Outcome::kBadLease);
  if (const auto bad = first_bad_property(claim.properties)) {
    return refuse(Outcome::kBadProperty, *bad);
  }
  if (byte_count(claim.properties) > limits().property_byte_max) {
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

// ---- reading --------------------------------------------------------------------------------

expected<const Record*, Refusal> Store::resolve(std::string_view name, MonotonicTime now) {
  expire(now);
  const auto place = find(name);
  if (!place) return unexpected{place.error()};
  return &(*place)->second;
}

expected<Page, Refusal> Store::list(std::string_view directory, std::string_view after,
                                    std::size_t count_max, MonotonicTime now) {
  expire(now);
  for (const std::string_view name : {directory, after}) {
    if (name.empty()) continue;
    if (const auto bad = first_bad_component(name)) return refuse(Outcome::kBadName, *bad);
  }
  // A directory lists the names that begin with it and a '/'; a bound name lists only itself.
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
