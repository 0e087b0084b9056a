#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

#include "change_log.hpp"
#include "interface_index.hpp"
#include "lapsed_names.hpp"
#include "rtpm/base/expected.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/names/claim.hpp"
#include "rtpm/names/limits.hpp"
#include "rtpm/names/outcome.hpp"
#include "rtpm/names/storage.hpp"

namespace rtpm::names {

/// One bound name. The storage does not store what a renewal changes.
struct Record {
  std::string name;
  std::string url;
  std::string interface;
  Owner owner{};
  MonotonicTime expires{};  ///< When its lease ends, unless renewed.
  /// A number that changes with the holder of the name.
  std::uint64_t revision = 0;
  MonotonicTime bound{};   ///< When this start of its owner bound it.
  std::uint64_t host = 0;  ///< See Claim::host.
  std::vector<Property> properties{};
  /// Revision of the last change other than a renewal; counted together with the holders'
  /// revisions.
  std::uint64_t change = 0;
  Duration lease{};  ///< Granted by the last bind; 0 if permanent.
  /// With a shared storage, the longest time that the name stays once nobody renews it.
  Duration stay{};

  [[nodiscard]] bool is_permanent() const noexcept { return lease == Duration{0}; }
};

/// A host's number, as in rpc::CallerHost; one number for all loopback addresses.
[[nodiscard]] constexpr std::uint64_t own_host_as_one(std::uint64_t host) noexcept {
  constexpr std::uint64_t kOwnHost = 0x7f00'0001;
  return host >> 24 == kOwnHost >> 24 ? kOwnHost : host;
}

/// Why an operation was refused.
struct Refusal {
  Outcome outcome = Outcome::kDone;
  /// The offending component of the name, or property for kBadProperty, from 0.
  std::uint8_t component = 0;
  /// The holder, for kAlreadyBound, kStaleEpoch and kNotOwner; valid until the next call.
  const Record* holder = nullptr;
};

/// The effect of a claim.
struct Plan {
  /// Revisions that are not assigned yet, its own or the holder's, equal Store::next_revision().
  Record next{};
  std::shared_ptr<const Record> former{};  ///< Null if the name is not bound.
  bool is_renewal = false;                 ///< Only the end of the lease changes.
  bool is_durable = false;
  [[nodiscard]] bool keeps_holder() const noexcept { return former && former->owner == next.owner; }
  [[nodiscard]] Granted granted() const noexcept;
};

/// A page of list().
struct Page {
  std::vector<const Record*>
      records{};        ///< In the order of their names; valid until the next call.
  bool is_last = true;  ///< No further names follow.
};

/// Bound names with their leases. It uses no clock and no socket: every operation takes the time,
/// which must not decrease, and first drops expired names. A lease that ends at `now` has ended.
/// @threads  one at a time
class Store {
 public:
  /// Revisions count from `first_revision`; choose another range for each start of a registry.
  /// A change is made only after `storage` has stored it; if null, names are in memory only.
  explicit Store(Limits limits = {}, std::uint64_t first_revision = 1, Storage* storage = nullptr);

  /// From now on a shared storage ends the leases, and apply() receives all changes.
  void share(const SharedStorage& storage, MonotonicTime now);
  [[nodiscard]] bool is_shared() const noexcept { return shared_ != nullptr; }
  /// Ends the record of a lapsed name for its owner, or for any caller with the revision of its
  /// last holder. Returns whether there was a record that this caller may end.
  /// @errors   of the storage
  [[nodiscard]] expected<bool, Refusal> dismiss(std::string_view name, Owner owner,
                                                std::uint64_t holder_revision);
  /// Applies changes of a shared storage. The log does not keep changes that share one revision.
  void apply(std::vector<SharedChange> changes, MonotonicTime now);
  /// Replaces everything with the full content of a shared storage.
  void apply_all(std::vector<StoredName> names, std::uint64_t revision, MonotonicTime now);
  /// Notes that the store has everything that was stored before `as_of`.
  void confirm(MonotonicTime as_of) noexcept;
  /// How often the shared storage confirmed the content.
  [[nodiscard]] std::uint64_t confirm_count() const noexcept { return confirm_count_; }
  /// How long the content may have been out of date; 0 if it is up to date.
  [[nodiscard]] Duration stale_for(MonotonicTime now) const noexcept;
  /// The effect that bind() or rebind() would have; changes nothing.
  [[nodiscard]] expected<Plan, Refusal> plan(const Claim& claim, bool replaces, MonotonicTime now);
  /// The effect that renew() would have: the renewed record, with its next lease.
  [[nodiscard]] expected<Plan, Refusal> plan_renewal(std::string_view name, Owner owner,
                                                     Duration lease, MonotonicTime now);
  /// The record that unbind() would remove; valid until the next call.
  [[nodiscard]] expected<const Record*, Refusal> plan_unbind(std::string_view name, Owner owner,
                                                             MonotonicTime now,
                                                             std::uint64_t holder_revision);
  /// Notes that a shared storage renewed the name.
  void note_renewal(std::string_view name, MonotonicTime now);
  /// The revision of the next change, unless a shared storage assigns revisions.
  [[nodiscard]] std::uint64_t next_revision() const noexcept { return next_revision_; }
  /// Keeps the error's text for storage_trouble().
  [[nodiscard]] Refusal refusal_of(const StorageError& error);

  /// Binds the names of a storage, before anything else, regardless of the limits. Leased names get
  /// a lease as for a first bind, so that their owners have time to renew them.
  void restore(std::vector<StoredName> names, MonotonicTime now);
  /// Restores the lapsed names of a storage, after restore().
  void restore_lapsed(std::vector<StoredLapse> lapsed);
  /// Why the last change was refused with kReadOnly, kStorageFull or kNotStored, in words.
  [[nodiscard]] const std::string& storage_trouble() const noexcept { return storage_trouble_; }

  /// Binds `claim.name`. If the same start of the owner holds it, replaces record and lease. A
  /// later start takes the name at once from the same host; from another host, which is not
  /// trusted, only after the lease.
  /// @errors   kAlreadyBound, kStaleEpoch with the holder · kNotADirectory, kIsADirectory · kFull,
  ///           kOwnerFull, kHostFull, kHostOwnersFull, kOwnerPropertiesFull, kPropertiesFull ·
  ///           kBadName, kBadUrl, kBadInterface, kBadOwner, kBadLease, kBadProperty
  [[nodiscard]] expected<Granted, Refusal> bind(const Claim& claim, MonotonicTime now);

  /// Binds like bind(), but takes the name from another owner if the claim names its revision or
  /// allows any takeover. An older start of the same owner still gets kStaleEpoch.
  /// @errors   as bind(), with kAlreadyBound if the claim allows no takeover · kStaleRevision with
  ///           the holder
  [[nodiscard]] expected<Granted, Refusal> rebind(const Claim& claim, MonotonicTime now);

  /// Extends the lease to `lease` from now, bounded as Granted::lease.
  /// @errors   kNotFound (bind again), kNotOwner, kStaleEpoch, kNotADirectory, kIsADirectory,
  ///           kBadLease, kBadName
  [[nodiscard]] expected<void, Refusal> renew(std::string_view name, Owner owner, Duration lease,
                                              MonotonicTime now);

  /// The record of a bound name, valid until the next call.
  /// @errors   kNotFound, kNotADirectory, kIsADirectory, kBadName
  [[nodiscard]] expected<const Record*, Refusal> resolve(std::string_view name, MonotonicTime now);

  /// Unbinds the name, for its owner or a later start of it; with `holder_revision` for any caller,
  /// if it is the holder's. Ends the record of a lapsed name.
  /// @errors   as renew() without a lease · kStaleRevision · of the storage
  [[nodiscard]] expected<void, Refusal> unbind(std::string_view name, Owner owner,
                                               MonotonicTime now,
                                               std::uint64_t holder_revision = 0);

  /// Returns up to `count_max` records that are `directory` or below it (all if empty) and sort
  /// after `after`, in byte order. To continue, pass the last name as `after`; concurrent changes
  /// affect no other names.
  /// @errors   kBadName, of either argument
  [[nodiscard]] expected<Page, Refusal> list(std::string_view directory, std::string_view after,
                                             std::size_t count_max, MonotonicTime now);

  /// Names by interface and properties, see query.hpp; drops expired names first.
  [[nodiscard]] const InterfaceIndex& index(MonotonicTime now) {
    expire(now);
    return index_;
  }

  /// Names whose lease ended without an unbind; drops expired ones first. With a shared storage:
  /// only those that were reported since the start.
  [[nodiscard]] const LapsedNames& lapsed(MonotonicTime now) {
    expire(now);
    return lapsed_;
  }
  /// The changes so far.
  [[nodiscard]] const ChangeLog& log() const noexcept { return log_; }
  /// Calls `visit` for the names that are `directory` or below it (all if empty) and sort after
  /// `after`, in byte order, until it returns false. Returns whether it reached the end.
  template <class Visit>
  [[nodiscard]] bool for_each_after(std::string_view after, std::string_view directory,
                                    Visit visit) const {
    auto place = after.empty() ? records_.lower_bound(directory) : records_.upper_bound(after);
    for (; place != records_.end() && place->first.starts_with(directory); ++place) {
      if (!visit(place->second)) return std::next(place) == records_.end();
    }
    return true;
  }
  /// Drops names whose lease has ended; every operation does so first.
  void expire(MonotonicTime now);
  /// When the next lease ends.
  [[nodiscard]] MonotonicTime next_expiry() const noexcept {
    return ends_.empty() ? kNever : ends_.begin()->first;
  }

  /// Bound names, including those that expired since the last operation.
  [[nodiscard]] std::size_t size() const noexcept { return records_.size(); }

  /// The number of names and owners of a host.
  struct HostUse {
    std::uint64_t host = 0;
    std::size_t name_count = 0;
    std::size_t owner_count = 0;
  };
  /// The `count_max` hosts with the most names, in descending order.
  [[nodiscard]] std::vector<HostUse> hosts(std::size_t count_max) const;
  /// The number of owners of names.
  [[nodiscard]] std::size_t owner_count() const noexcept { return owners_.size(); }
  [[nodiscard]] const Limits& limits() const noexcept { return limits_; }

 private:
  using Records = std::map<std::string, Record, std::less<>>;

  void keep_as_lapsed(const Record& record, MonotonicTime ended);
  /// Logs that the name has gone.
  void drop(Records::iterator place);
  void erase(Records::iterator place);
  [[nodiscard]] Record record_of(const Claim& claim, const Record* kept, MonotonicTime now) const;
  [[nodiscard]] Plan plan_of(const Claim& claim, Records::iterator held, MonotonicTime now) const;
  /// Carries out a plan.
  [[nodiscard]] expected<Granted, Refusal> put(Plan plan);
  void insert(Record record);
  void apply(SharedChange change, bool is_logged, MonotonicTime now);
  [[nodiscard]] Record record_of(StoredName stored, MonotonicTime now) const;
  [[nodiscard]] expected<std::uint64_t, Refusal> commit(const StoredChange& change);
  [[nodiscard]] expected<Granted, Refusal> bind(const Claim& claim, bool replaces,
                                                MonotonicTime now);
  [[nodiscard]] expected<void, Refusal> check_holder(const Claim& claim, const Record& held,
                                                     bool replaces) const;
  [[nodiscard]] expected<void, Refusal> check_claim(const Claim& claim) const;
  [[nodiscard]] expected<void, Refusal> check_place(std::string_view name) const;
  [[nodiscard]] expected<void, Refusal> check_room(const Claim& claim, const Record* held) const;
  [[nodiscard]] expected<void, Refusal> check_properties(const Claim& claim,
                                                         const Record* held) const;
  [[nodiscard]] expected<void, Refusal> check_host(const Claim& claim, const Record* held) const;
  [[nodiscard]] expected<Records::iterator, Refusal> find(std::string_view name);
  [[nodiscard]] bool is_directory(std::string_view name) const;
  [[nodiscard]] Refusal missing(std::string_view name) const;

  Limits limits_;
  Records records_{};
  /// Ordered by the end of the lease, so that expiry does not visit other names.
  std::set<std::pair<MonotonicTime, std::string_view>> ends_{};
  struct OwnerUse {
    std::size_t name_count = 0;
    std::size_t property_byte_count = 0;
  };
  std::unordered_map<std::uint64_t, OwnerUse> owners_{};  ///< The owners of names.
  std::size_t property_byte_count_ = 0;
  InterfaceIndex index_{};
  struct Host {
    std::size_t name_count = 0;
    std::unordered_map<std::uint64_t, std::size_t> count_of_owner{};
  };
  std::unordered_map<std::uint64_t, Host> hosts_{};  ///< The hosts that hold names.
  std::uint64_t next_revision_;
  ChangeLog log_;
  LapsedNames lapsed_{};
  Storage* storage_;
  std::string storage_trouble_{};
  const SharedStorage* shared_ = nullptr;
  MonotonicTime current_as_of_{};
  std::uint64_t confirm_count_ = 0;
};

/// A record in the form that a storage keeps.
[[nodiscard]] StoredName stored_name_of(const Record& record);

/// The content counts as out of date when a shared storage has not confirmed it for that long.
inline constexpr Duration kStaleAfter = std::chrono::seconds{2};

}  // namespace rtpm::names
