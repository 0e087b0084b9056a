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

/// One bound name. What a renewal changes is not stored.
struct Record {
  std::string name;
  std::string url;
  std::string interface;
  Owner owner{};
  MonotonicTime expires{};  ///< When its lease ends, unless renewed.
  /// Changes with the holder of the name.
  std::uint64_t revision = 0;
  MonotonicTime bound{};   ///< When this start of its owner bound it.
  std::uint64_t host = 0;  ///< See Claim::host.
  std::vector<Property> properties{};
  /// Of the last change, other than a renewal; counted together with the holders' revisions.
  std::uint64_t change = 0;
  Duration lease{};  ///< As granted by the last bind; 0: it is permanent.
  /// Of a shared storage: how long it at most stays once nobody renews it.
  Duration stay{};

  [[nodiscard]] bool is_permanent() const noexcept { return lease == Duration{0}; }
};

/// A host's number, as rpc::CallerHost has it; one for all loopback addresses.
[[nodiscard]] constexpr std::uint64_t own_host_as_one(std::uint64_t host) noexcept {
  constexpr std::uint64_t kOwnHost = 0x7f00'0001;
  return host >> 24 == kOwnHost >> 24 ? kOwnHost : host;
}

/// Why an operation was refused.
struct Refusal {
  Outcome outcome = Outcome::kDone;
  /// The offending component of the name, or property of kBadProperty, from 0.
  std::uint8_t component = 0;
  /// The holder, for kAlreadyBound, kStaleEpoch and kNotOwner; valid until the next call.
  const Record* holder = nullptr;
};

/// What a claim comes to.
struct Plan {
  /// A revision, and a holder's, that are still to be given equal Store::next_revision().
  Record next{};
  std::shared_ptr<const Record> former{};  ///< Null: the name is not bound.
  bool is_renewal = false;                 ///< Nothing changes but the end of the lease.
  bool is_durable = false;
  [[nodiscard]] bool keeps_holder() const noexcept { return former && former->owner == next.owner; }
  [[nodiscard]] Granted granted() const noexcept;
};

/// A page of list().
struct Page {
  std::vector<const Record*>
      records{};        ///< In the order of their names; valid until the next call.
  bool is_last = true;  ///< No further names.
};

/// Bound names with their leases. No clock, no socket: every operation takes the time, which must
/// not decrease, and first drops expired names. A lease that ends at `now` has ended.
/// @threads  one at a time
class Store {
 public:
  /// Revisions count from `first_revision`; choose another range for each start of a registry.
  /// A change happens only after `storage` has it; null: none keeps it.
  explicit Store(Limits limits = {}, std::uint64_t first_revision = 1, Storage* storage = nullptr);

  /// From now on a shared storage ends the leases, and apply() has all changes.
  void share(const SharedStorage& storage, MonotonicTime now);
  [[nodiscard]] bool is_shared() const noexcept { return shared_ != nullptr; }
  /// Ends the record of a lapsed name for its owner, or for any caller with the revision of its
  /// last holder. Whether it was there and might be.
  /// @errors   of the storage
  [[nodiscard]] expected<bool, Refusal> dismiss(std::string_view name, Owner owner,
                                                std::uint64_t holder_revision);
  /// What a shared storage has told. Of several changes with one revision the log knows nothing.
  void apply(std::vector<SharedChange> changes, MonotonicTime now);
  /// The full content of a shared storage, in place of what was here.
  void apply_all(std::vector<StoredName> names, std::uint64_t revision, MonotonicTime now);
  /// Everything that was stored before `as_of` is here.
  void confirm(MonotonicTime as_of) noexcept;
  /// How often it was confirmed.
  [[nodiscard]] std::uint64_t confirm_count() const noexcept { return confirm_count_; }
  /// For how long what is here may have been out of date; 0: it is not.
  [[nodiscard]] Duration stale_for(MonotonicTime now) const noexcept;
  /// What bind() or rebind() would do, without doing it.
  [[nodiscard]] expected<Plan, Refusal> plan(const Claim& claim, bool replaces, MonotonicTime now);
  /// What renew() would do: the record that is renewed, with its next lease.
  [[nodiscard]] expected<Plan, Refusal> plan_renewal(std::string_view name, Owner owner,
                                                     Duration lease, MonotonicTime now);
  /// What unbind() would remove; valid until the next call.
  [[nodiscard]] expected<const Record*, Refusal> plan_unbind(std::string_view name, Owner owner,
                                                             MonotonicTime now,
                                                             std::uint64_t holder_revision);
  /// A renewal of a shared storage has happened.
  void note_renewal(std::string_view name, MonotonicTime now);
  /// What the next change gets, where no shared storage gives revisions.
  [[nodiscard]] std::uint64_t next_revision() const noexcept { return next_revision_; }
  /// Keeps the words of an error, for storage_trouble().
  [[nodiscard]] Refusal refusal_of(const StorageError& error);

  /// Binds what a storage had, before anything else, whatever the limits are. Leased names get a
  /// lease as for a first bind, so that their owners have the time to renew them.
  void restore(std::vector<StoredName> names, MonotonicTime now);
  /// What a storage had as lapsed, behind restore().
  void restore_lapsed(std::vector<StoredLapse> lapsed);
  /// Why the last change that was refused with kReadOnly, kStorageFull or kNotStored was, in words.
  [[nodiscard]] const std::string& storage_trouble() const noexcept { return storage_trouble_; }

  /// Binds `claim.name`. If the same start of the owner holds it, replaces record and lease. A
  /// later start takes the name at once from the same host; from another host, which is not
  /// trusted, only after the lease.
  /// @errors   kAlreadyBound, kStaleEpoch with the holder · kNotADirectory, kIsADirectory · kFull,
  ///           kOwnerFull, kHostFull, kHostOwnersFull, kOwnerPropertiesFull, kPropertiesFull ·
  ///           kBadName, kBadUrl, kBadInterface, kBadOwner, kBadLease, kBadProperty
  [[nodiscard]] expected<Granted, Refusal> bind(const Claim& claim, MonotonicTime now);

  /// As bind(), but takes the name from another owner if the claim names its revision or allows any
  /// takeover. An older start of the same owner still gets kStaleEpoch.
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
  /// if the holder is that one. Of a lapsed name it ends the record.
  /// @errors   as renew() without a lease · kStaleRevision · of the storage
  [[nodiscard]] expected<void, Refusal> unbind(std::string_view name, Owner owner,
                                               MonotonicTime now,
                                               std::uint64_t holder_revision = 0);

  /// Up to `count_max` records that are `directory` or below it (empty: all) and sort after
  /// `after`, in byte order. To continue, pass the last name as `after`; concurrent changes affect
  /// no other names.
  /// @errors   kBadName, of either argument
  [[nodiscard]] expected<Page, Refusal> list(std::string_view directory, std::string_view after,
                                             std::size_t count_max, MonotonicTime now);

  /// Names by interface and properties, see query.hpp; drops expired ones first.
  [[nodiscard]] const InterfaceIndex& index(MonotonicTime now) {
    expire(now);
    return index_;
  }

  /// Names whose lease ended without an unbind; drops expired ones first. Of a shared storage these
  /// are the ones that were told since the start.
  [[nodiscard]] const LapsedNames& lapsed(MonotonicTime now) {
    expire(now);
    return lapsed_;
  }
  /// The changes so far.
  [[nodiscard]] const ChangeLog& log() const noexcept { return log_; }
  /// Calls `visit` for the names that are `directory` or below it (empty: all) and sort after
  /// `after`, in byte order, until it returns false; whether it got to the end.
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

  /// What a host holds.
  struct HostUse {
    std::uint64_t host = 0;
    std::size_t name_count = 0;
    std::size_t owner_count = 0;
  };
  /// The `count_max` hosts with the most names, most first.
  [[nodiscard]] std::vector<HostUse> hosts(std::size_t count_max) const;
  /// Owners of names.
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
  /// Does what was planned.
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
  /// By the end of the lease, so that expiry does not visit other names.
  std::set<std::pair<MonotonicTime, std::string_view>> ends_{};
  struct OwnerUse {
    std::size_t name_count = 0;
    std::size_t property_byte_count = 0;
  };
  std::unordered_map<std::uint64_t, OwnerUse> owners_{};  ///< Those of names.
  std::size_t property_byte_count_ = 0;
  InterfaceIndex index_{};
  struct Host {
    std::size_t name_count = 0;
    std::unordered_map<std::uint64_t, std::size_t> count_of_owner{};
  };
  std::unordered_map<std::uint64_t, Host> hosts_{};  ///< Those that hold names.
  std::uint64_t next_revision_;
  ChangeLog log_;
  LapsedNames lapsed_{};
  Storage* storage_;
  std::string storage_trouble_{};
  const SharedStorage* shared_ = nullptr;
  MonotonicTime current_as_of_{};
  std::uint64_t confirm_count_ = 0;
};

/// As a storage keeps it.
[[nodiscard]] StoredName stored_name_of(const Record& record);

/// What is here counts as out of date when a shared storage has not confirmed it for that long.
inline constexpr Duration kStaleAfter = std::chrono::seconds{2};

}  // namespace rtpm::names
