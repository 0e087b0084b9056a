#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

#include "rtpm/base/expected.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/names/name.hpp"
#include "rtpm/names/outcome.hpp"

namespace rtpm::names {

/// Who binds a name. The id stays the same when the owner restarts, the epoch grows with every
/// start: so a restarted owner takes its names over at once, and nobody else does by accident.
struct Owner {
  std::uint64_t id = 0;  ///< Never 0.
  std::uint64_t epoch = 0;
  friend bool operator==(const Owner&, const Owner&) = default;
};

/// One bound name.
struct Record {
  std::string name;
  std::string url;
  std::string interface;
  Owner owner{};
  MonotonicTime expires{};  ///< When its lease ends, unless renewed.
};

/// What a store takes in, and no more.
struct Limits {
  std::size_t name_count_max = 4096;
  std::size_t name_count_per_owner_max = 256;
  Duration lease_min = std::chrono::milliseconds{100};
  Duration lease_max = std::chrono::hours{1};
};

/// Why the store did nothing.
struct Refusal {
  Outcome outcome = Outcome::kDone;
  /// Which component of the name it is about, counted from 0.
  std::uint8_t component = 0;
  /// Who holds the name, for kAlreadyBound, kStaleEpoch and kNotOwner; valid until the next call.
  const Record* holder = nullptr;
};

/// A part of a list.
struct Page {
  std::vector<const Record*>
      records{};        ///< In the order of their names; valid until the next call.
  bool is_last = true;  ///< Nothing follows them.
};

/// The names that are bound, with their leases. It knows no clock and no socket: every operation is
/// told the time, which must not run backwards, and first drops the names whose leases have ended.
/// A lease that ends at `now` has ended.
/// Threads: one at a time.   Allocates; not for real-time threads.
class Store {
 public:
  explicit Store(Limits limits = {});

  /// What a name is to be bound to.
  struct Wish {
    std::string_view name;
    std::string_view url;
    std::string_view interface;
    Owner owner{};
    Duration lease{};
  };

  /// Binds `wish.name`. If the same owner holds it, with this epoch or an older one, its record is
  /// replaced and its lease begins anew; so repeating a bind does no harm.
  /// Errors: kAlreadyBound, kStaleEpoch with the holder; kNotADirectory, kIsADirectory; kFull,
  /// kOwnerFull; kBadName, kBadUrl, kBadInterface, kBadOwner, kBadLease.
  [[nodiscard]] expected<void, Refusal> bind(const Wish& wish, MonotonicTime now);

  /// As bind(), but takes the name away from another owner, whose renew() then fails. An older
  /// start of the same owner still gets kStaleEpoch.
  [[nodiscard]] expected<void, Refusal> rebind(const Wish& wish, MonotonicTime now);

  /// Lets the lease end `lease` from now.
  /// Errors: kNotFound (bind again), kNotOwner, kStaleEpoch, kNotADirectory, kIsADirectory,
  /// kBadLease, kBadName.
  [[nodiscard]] expected<void, Refusal> renew(std::string_view name, Owner owner, Duration lease,
                                              MonotonicTime now);

  /// The record of a bound name, valid until the next call.
  /// Errors: kNotFound, kNotADirectory, kIsADirectory, kBadName.
  [[nodiscard]] expected<const Record*, Refusal> resolve(std::string_view name, MonotonicTime now);

  /// Takes the name away. A later start of its owner may, too.
  /// Errors: as renew() without a lease.
  [[nodiscard]] expected<void, Refusal> unbind(std::string_view name, Owner owner,
                                               MonotonicTime now);

  /// Up to `count_max` records whose names are `directory` or below it (empty: all) and come after
  /// `after` (empty: from the begin), in the order of their bytes. Nothing there is an empty page.
  /// To go on, give the last name as `after`; names that come and go meanwhile disturb no others.
  /// Errors: kBadName, of either argument.
  [[nodiscard]] expected<Page, Refusal> list(std::string_view directory, std::string_view after,
                                             std::size_t count_max, MonotonicTime now);

  /// How many names are bound, those included whose leases ended since the last operation.
  [[nodiscard]] std::size_t size() const noexcept { return records_.size(); }
  [[nodiscard]] const Limits& limits() const noexcept { return limits_; }

 private:
  using Records = std::map<std::string, Record, std::less<>>;

  void expire(MonotonicTime now);
  void erase(Records::iterator place);
  void put(const Wish& wish, MonotonicTime now);
  [[nodiscard]] expected<void, Refusal> bind(const Wish& wish, bool replaces, MonotonicTime now);
  [[nodiscard]] expected<void, Refusal> check_wish(const Wish& wish) const;
  [[nodiscard]] expected<void, Refusal> check_place(std::string_view name) const;
  [[nodiscard]] expected<void, Refusal> check_room(const Wish& wish) const;
  [[nodiscard]] expected<Records::iterator, Refusal> find(std::string_view name);
  [[nodiscard]] bool is_directory(std::string_view name) const;
  [[nodiscard]] Refusal missing(std::string_view name) const;

  Limits limits_;
  Records records_{};
  /// The names by the end of their leases, so that dropping the ended ones costs nothing for
  /// others.
  std::set<std::pair<MonotonicTime, std::string_view>> ends_{};
  std::unordered_map<std::uint64_t, std::size_t> count_of_owner_{};
};

}  // namespace rtpm::names
