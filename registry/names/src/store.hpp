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
#include "rtpm/names/claim.hpp"
#include "rtpm/names/limits.hpp"
#include "rtpm/names/outcome.hpp"

namespace rtpm::names {

/// One bound name.
struct Record {
  std::string name;
  std::string url;
  std::string interface;
  Owner owner{};
  MonotonicTime expires{};  ///< When its lease ends, unless renewed.
  /// Another number for each holder that the name ever had; the same for as long as one holds it.
  std::uint64_t revision = 0;
  MonotonicTime bound{};   ///< Since when this start of its owner holds it.
  std::uint32_t host = 0;  ///< From which it was bound, see Claim.
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
/// @threads  one at a time. Allocates; not for real-time threads
class Store {
 public:
  /// Revisions count from `first_revision` on; give each life of a registry another range.
  explicit Store(Limits limits = {}, std::uint64_t first_revision = 1);

  /// Binds `claim.name`. If this start of this owner holds it, its record is replaced and its
  /// lease begins anew; so repeating a bind does no harm. A later start of the owner takes the name
  /// at once if it comes from the host that the name was bound from; from elsewhere it waits for
  /// the lease to end, as anybody could claim to be it.
  /// @errors   kAlreadyBound, kStaleEpoch with the holder · kNotADirectory, kIsADirectory · kFull,
  ///           kOwnerFull, kHostFull, kHostOwnersFull · kBadName, kBadUrl, kBadInterface, kBadOwner,
  ///           kBadLease
  [[nodiscard]] expected<Granted, Refusal> bind(const Claim& claim, MonotonicTime now);

  /// As bind(), but takes the name away from another owner, whose renew() then fails, if the
  /// claim names that holder's revision or allows any takeover. An older start of the same owner
  /// still gets kStaleEpoch.
  /// @errors   as bind(), with kAlreadyBound where the claim gives no leave · kStaleRevision with
  ///           the holder: it is another one than the claim names
  [[nodiscard]] expected<Granted, Refusal> rebind(const Claim& claim, MonotonicTime now);

  /// Lets the lease end `lease` from now, or first_lease_max, see Granted.
  /// @errors   kNotFound (bind again), kNotOwner, kStaleEpoch, kNotADirectory, kIsADirectory,
  ///           kBadLease, kBadName
  [[nodiscard]] expected<void, Refusal> renew(std::string_view name, Owner owner, Duration lease,
                                              MonotonicTime now);

  /// The record of a bound name, valid until the next call.
  /// @errors   kNotFound, kNotADirectory, kIsADirectory, kBadName
  [[nodiscard]] expected<const Record*, Refusal> resolve(std::string_view name, MonotonicTime now);

  /// Takes the name away. A later start of its owner may, too.
  /// @errors   as renew() without a lease
  [[nodiscard]] expected<void, Refusal> unbind(std::string_view name, Owner owner,
                                               MonotonicTime now);

  /// Up to `count_max` records whose names are `directory` or below it (empty: all) and come after
  /// `after` (empty: from the begin), in the order of their bytes. Nothing there is an empty page.
  /// To go on, give the last name as `after`; names that come and go meanwhile disturb no others.
  /// @errors   kBadName, of either argument
  [[nodiscard]] expected<Page, Refusal> list(std::string_view directory, std::string_view after,
                                             std::size_t count_max, MonotonicTime now);

  /// How many names are bound, those included whose leases ended since the last operation.
  [[nodiscard]] std::size_t size() const noexcept { return records_.size(); }

  /// What a host holds.
  struct HostUse {
    std::uint32_t host = 0;
    std::size_t name_count = 0;
    std::size_t owner_count = 0;
  };
  /// Of the hosts that hold any, the `count_max` with the most names, most first.
  [[nodiscard]] std::vector<HostUse> hosts(std::size_t count_max) const;
  /// How many owners hold names.
  [[nodiscard]] std::size_t owner_count() const noexcept { return count_of_owner_.size(); }
  [[nodiscard]] const Limits& limits() const noexcept { return limits_; }

 private:
  using Records = std::map<std::string, Record, std::less<>>;

  void expire(MonotonicTime now);
  void erase(Records::iterator place);
  [[nodiscard]] Granted put(const Claim& claim, const Record* kept, MonotonicTime now);
  [[nodiscard]] expected<Granted, Refusal> bind(const Claim& claim, bool replaces,
                                                MonotonicTime now);
  [[nodiscard]] expected<void, Refusal> check_holder(const Claim& claim, const Record& held,
                                                     bool replaces) const;
  [[nodiscard]] expected<void, Refusal> check_claim(const Claim& claim) const;
  [[nodiscard]] expected<void, Refusal> check_place(std::string_view name) const;
  [[nodiscard]] expected<void, Refusal> check_room(const Claim& claim, const Record* held) const;
  [[nodiscard]] expected<void, Refusal> check_host(const Claim& claim, const Record* held) const;
  [[nodiscard]] expected<Records::iterator, Refusal> find(std::string_view name);
  [[nodiscard]] bool is_directory(std::string_view name) const;
  [[nodiscard]] Refusal missing(std::string_view name) const;

  Limits limits_;
  Records records_{};
  /// The names by the end of their leases, so that dropping the ended ones costs nothing for
  /// others.
  std::set<std::pair<MonotonicTime, std::string_view>> ends_{};
  std::unordered_map<std::uint64_t, std::size_t> count_of_owner_{};
  struct Host {
    std::size_t name_count = 0;
    std::unordered_map<std::uint64_t, std::size_t> count_of_owner{};
  };
  std::unordered_map<std::uint32_t, Host> hosts_{};  ///< Those that hold names.
  std::uint64_t next_revision_;
};

}  // namespace rtpm::names
