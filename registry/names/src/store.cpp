#include "rtpm/names/store.hpp"

#include <algorithm>

namespace rtpm::names {
namespace {

unexpected<Refusal> refuse(Outcome outcome, std::size_t component = 0,
                           const Record* holder = nullptr) {
  return unexpected<Refusal>{{outcome, static_cast<std::uint8_t>(component), holder}};
}

std::size_t last_component(std::string_view name) {
  return static_cast<std::size_t>(std::count(name.begin(), name.end(), '/'));
}

/// Whether a record's holder is the very start of the very owner; the refusal if not. A later start
/// may end what an earlier one began, but has to bind before it renews.
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

Store::Store(Limits limits) : limits_(limits) {}

expected<void, Refusal> Store::bind(const Wish& wish, MonotonicTime now) {
  return bind(wish, /*replaces=*/false, now);
}
expected<void, Refusal> Store::rebind(const Wish& wish, MonotonicTime now) {
  return bind(wish, /*replaces=*/true, now);
}

expected<void, Refusal> Store::bind(const Wish& wish, bool replaces, MonotonicTime now) {
  expire(now);
  if (auto checked = check_wish(wish); !checked) return checked;
  const auto place = records_.find(wish.name);
  if (place == records_.end()) {
    if (auto checked = check_place(wish.name); !checked) return checked;
    if (auto checked = check_room(wish); !checked) return checked;
    put(wish, now);
    return {};
  }
  const Record& held = place->second;
  const std::size_t last = last_component(wish.name);
  if (held.owner.id != wish.owner.id) {
    if (!replaces) return refuse(Outcome::kAlreadyBound, last, &held);
    if (auto checked = check_room(wish); !checked) return checked;
  } else if (wish.owner.epoch < held.owner.epoch) {
    return refuse(Outcome::kStaleEpoch, last, &held);
  }
  erase(place);
  put(wish, now);
  return {};
}

expected<void, Refusal> Store::renew(std::string_view name, Owner owner, Duration lease,
                                     MonotonicTime now) {
  expire(now);
  if (lease < limits_.lease_min || lease > limits_.lease_max) return refuse(Outcome::kBadLease);
  const auto place = find(name);
  if (!place) return unexpected{place.error()};
  Record& record = (*place)->second;
  if (auto checked = check_owner(record, owner, /*may_be_later=*/false); !checked) return checked;
  ends_.erase({record.expires, record.name});
  record.expires = now + lease;
  ends_.emplace(record.expires, record.name);
  return {};
}

expected<const Record*, Refusal> Store::resolve(std::string_view name, MonotonicTime now) {
  expire(now);
  const auto place = find(name);
  if (!place) return unexpected{place.error()};
  return &(*place)->second;
}

expected<void, Refusal> Store::unbind(std::string_view name, Owner owner, MonotonicTime now) {
  expire(now);
  const auto place = find(name);
  if (!place) return unexpected{place.error()};
  auto checked = check_owner((*place)->second, owner, /*may_be_later=*/true);
  if (checked) erase(*place);
  return checked;
}

expected<Page, Refusal> Store::list(std::string_view directory, std::string_view after,
                                    std::size_t count_max, MonotonicTime now) {
  expire(now);
  for (const std::string_view name : {directory, after}) {
    if (name.empty()) continue;
    if (const auto bad = first_bad_component(name)) return refuse(Outcome::kBadName, *bad);
  }
  // What is below a directory are the names that begin with it and a '/'; a bound name is a list of
  // itself.
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
    erase(records_.find(ends_.begin()->second));
  }
}

void Store::erase(Records::iterator place) {
  const Record& record = place->second;
  ends_.erase({record.expires, record.name});
  const auto count = count_of_owner_.find(record.owner.id);
  if (--count->second == 0) count_of_owner_.erase(count);
  records_.erase(place);
}

void Store::put(const Wish& wish, MonotonicTime now) {
  const std::string name(wish.name);
  Record& record = records_[name];
  record = {name, std::string(wish.url), std::string(wish.interface), wish.owner, now + wish.lease};
  ends_.emplace(record.expires, record.name);
  ++count_of_owner_[wish.owner.id];
}

expected<void, Refusal> Store::check_wish(const Wish& wish) const {
  if (const auto bad = first_bad_component(wish.name)) return refuse(Outcome::kBadName, *bad);
  if (!is_url(wish.url)) return refuse(Outcome::kBadUrl);
  if (!is_interface(wish.interface)) return refuse(Outcome::kBadInterface);
  if (wish.owner.id == 0) return refuse(Outcome::kBadOwner);
  if (wish.lease < limits_.lease_min || wish.lease > limits_.lease_max) {
    return refuse(Outcome::kBadLease);
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

expected<void, Refusal> Store::check_room(const Wish& wish) const {
  if (records_.size() >= limits_.name_count_max && !records_.contains(wish.name)) {
    return refuse(Outcome::kFull);
  }
  const auto count = count_of_owner_.find(wish.owner.id);
  if ((count == count_of_owner_.end() ? 0 : count->second) >= limits_.name_count_per_owner_max) {
    return refuse(Outcome::kOwnerFull);
  }
  return {};
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
