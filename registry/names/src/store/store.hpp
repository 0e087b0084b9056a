#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "model/interface_index.hpp"
#include "model/record.hpp"
#include "rtpm/base/expected.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/names/claim.hpp"
#include "rtpm/names/limits.hpp"
#include "rtpm/names/outcome.hpp"
#include "rtpm/names/storage.hpp"
#include "store/change_log.hpp"
#include "store/lapsed_names.hpp"
#include "store/usage.hpp"

namespace rtpm::names {

/// Why an operation was refused.
struct Refusal {
  Outcome outcome = Outcome::kDone;
  /// The index of the offending component or, for kBadProperty, property.
  std::uint8_t component = 0;
  /// The holder, for kAlreadyBound, kStaleEpoch, kStaleRevision and kNotOwner.
  std::shared_ptr<const Record> holder{};
};

/// The result of a bind.
struct Bound : Granted {
  /// The previous record, of another owner; null if there was none.
  std::shared_ptr<const Record> taken_from{};
};

/// A page of list().
struct Page {
  /// In the order of their names; valid until the next call.
  std::vector<const Record*> records{};
  bool is_last = true;  ///< No further names follow.
};

/// Bound names with their leases. Uses no clock and no socket: every operation takes the time,
/// which must not decrease, and first drops expired names. A lease that ends at `now` has ended. A
/// change takes effect once the storage has stored it. While a shared storage waits, at most until
/// `deadline`, other threads may use the store (see Storage).
/// @threads  one at a time
class Store {
 public:
  /// Revisions start at `first_revision`; choose another range for each start of a registry. If
  /// `storage` is null, names are in memory only.
  explicit Store(Limits limits = {}, std::uint64_t first_revision = 1, Storage* storage = nullptr);

  /// Binds a storage's names, before anything else, ignoring the limits; leaves out names that the
  /// rules refuse. Leased names get a first lease, so that their owners have time to renew.
  void restore(std::vector<StoredName> names, MonotonicTime now);
  /// Restores a storage's lapsed names, after restore().
  void restore_lapsed(std::vector<StoredLapse> lapsed);
  /// Applies changes that the storage reports. The log does not keep changes that share a revision.
  void take(std::vector<ReportedChange> changes, MonotonicTime now);
  /// Replaces everything with the full content of the storage.
  void take_all(std::vector<StoredName> names, std::uint64_t revision, MonotonicTime now);
  /// The revision of the next change, unless the storage assigns revisions.
  [[nodiscard]] std::uint64_t next_revision() const noexcept { return next_revision_; }
  /// Why the storage last refused a change, in words.
  [[nodiscard]] const std::string& storage_trouble() const noexcept { return storage_trouble_; }

  /// Binds `claim.name`. If the same start of the owner holds it, replaces record and lease. A
  /// later start on the same host takes the name at once; on another host, which is not trusted,
  /// only after the lease has ended.
  /// @errors   kAlreadyBound, kStaleEpoch with the holder · kNotADirectory, kIsADirectory · kFull,
  ///           kOwnerFull, kHostFull, kHostOwnersFull, kOwnerPropertiesFull, kPropertiesFull ·
  ///           kBadName, kBadUrl, kBadInterface, kBadOwner, kBadLease, kBadProperty · kReadOnly,
  ///           kStorageFull, kNotStored, kStoreUnreachable: see storage_trouble()
  [[nodiscard]] expected<Bound, Refusal> bind(const Claim& claim, MonotonicTime now,
                                              MonotonicTime deadline = kNever) {
    return bind(claim, /*replaces=*/false, now, deadline);
  }
  /// Binds like bind(), but takes the name from another owner if the claim names its revision or
  /// allows any takeover. An older start of the same owner still gets kStaleEpoch.
  /// @errors   those of bind(), with kAlreadyBound if the claim allows no takeover · kStaleRevision
  ///           with the holder
  [[nodiscard]] expected<Bound, Refusal> rebind(const Claim& claim, MonotonicTime now,
                                                MonotonicTime deadline = kNever) {
    return bind(claim, /*replaces=*/true, now, deadline);
  }
  /// Extends the lease to `lease` from now, bounded like Granted::lease.
  /// @errors   kNotFound (bind again), kNotOwner, kStaleEpoch, kNotADirectory, kIsADirectory,
  ///           kBadLease, kBadName · of the storage
  [[nodiscard]] expected<void, Refusal> renew(std::string_view name, Owner owner, Duration lease,
                                              MonotonicTime now, MonotonicTime deadline = kNever);
  /// Unbinds the name, for its owner or a later start of it; with `holder_revision`, for any
  /// caller, if it matches the holder. Removes the record of a lapsed name.
  /// @errors   those of renew() without a lease · kStaleRevision
  [[nodiscard]] expected<void, Refusal> unbind(std::string_view name, Owner owner,
                                               MonotonicTime now, std::uint64_t holder_revision = 0,
                                               MonotonicTime deadline = kNever);

  /// The record of a bound name; valid until the next call.
  /// @errors   kNotFound, kNotADirectory, kIsADirectory, kBadName
  [[nodiscard]] expected<const Record*, Refusal> resolve(std::string_view name, MonotonicTime now);

  /// Returns up to `count_max` records that are `directory` or below it (all if empty) and come
  /// after `after`, in byte order. To continue, pass the last name as `after`; concurrent changes
  /// do not affect other names.
  /// @errors   kBadName, of either argument
  [[nodiscard]] expected<Page, Refusal> list(std::string_view directory, std::string_view after,
                                             std::size_t count_max, MonotonicTime now);

  /// The names by interface and properties, see query.hpp; drops expired names first.
  [[nodiscard]] const InterfaceIndex& index(MonotonicTime now) {
    expire(now);
    return index_;
  }

  /// Names whose lease ended without an unbind; drops expired ones first. If the storage reports
  /// changes, only those since the start.
  [[nodiscard]] const LapsedNames& lapsed(MonotonicTime now) {
    expire(now);
    return lapsed_;
  }
  /// The changes so far.
  [[nodiscard]] const ChangeLog& log() const noexcept { return log_; }
  /// Calls `visit` for the names that are `directory` or below it (all if empty) and come after
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
  /// When the next lease ends, except leases that the storage ends.
  [[nodiscard]] MonotonicTime next_expiry() const noexcept {
    return ends_.empty() ? kNever : ends_.begin()->first;
  }

  /// Bound names, including those that expired since the last operation.
  [[nodiscard]] std::size_t size() const noexcept { return records_.size(); }

  [[nodiscard]] const Usage& usage() const noexcept { return usage_; }
  [[nodiscard]] const Limits& limits() const noexcept { return usage_.limits(); }

 private:
  using Records = std::map<std::string, Record, std::less<>>;
  /// A change that the rules allow.
  struct Change {
    std::shared_ptr<const Record> former{};  ///< Null if the name is not bound.
    /// nullopt to unbind the name. Revisions not assigned yet, its own or the holder's, equal
    /// next_revision().
    std::optional<Record> next{};
    bool is_renewal = false;  ///< Only the lease changes.
    [[nodiscard]] bool keeps_holder() const noexcept {
      return former && next && former->owner == next->owner;
    }
  };
  using Checked = expected<Change, Refusal>;

  /// Checks a change by the rules, stores and applies it; checks again if another registry was
  /// first.
  template <class Check>
  [[nodiscard]] Checked carry_out(std::string_view name, MonotonicTime now, MonotonicTime deadline,
                                  Check check);
  [[nodiscard]] expected<std::uint64_t, StorageError> store(const Change& change,
                                                            MonotonicTime deadline);
  [[nodiscard]] expected<std::uint64_t, StorageError> confirm(std::string_view name,
                                                              const Refusal& refusal,
                                                              MonotonicTime deadline);
  void make(Change& change, std::uint64_t revision, MonotonicTime now);
  void start_lease(const Record& renewed, MonotonicTime now);
  /// Replaces or removes the record of a name, and logs that.
  void put(const std::string& name, std::optional<Record> next, std::uint64_t revision,
           bool is_logged = true);
  void insert(Record record);
  void erase(Records::iterator place);
  void keep_as_lapsed(const Record& record, MonotonicTime ended);
  [[nodiscard]] expected<void, StorageError> drop_lapsed(std::string_view name);

  [[nodiscard]] expected<Bound, Refusal> bind(const Claim& claim, bool replaces, MonotonicTime now,
                                              MonotonicTime deadline);
  [[nodiscard]] Checked check_bind(const Claim& claim, bool replaces, MonotonicTime now);
  [[nodiscard]] Checked check_renewal(std::string_view name, Owner owner, Duration lease,
                                      MonotonicTime now);
  [[nodiscard]] Checked check_unbind(std::string_view name, Owner owner, MonotonicTime now,
                                     std::uint64_t holder_revision);
  [[nodiscard]] expected<void, Refusal> check_claim(const Claim& claim) const;
  [[nodiscard]] expected<void, Refusal> check_place(std::string_view name) const;
  [[nodiscard]] Change change_of(const Claim& claim, const Record* held, MonotonicTime now) const;
  [[nodiscard]] Record record_of(const Claim& claim, const Record* kept, MonotonicTime now) const;
  [[nodiscard]] Record record_of(StoredName stored, MonotonicTime now) const;
  [[nodiscard]] expected<Records::iterator, Refusal> find(std::string_view name);
  [[nodiscard]] bool is_directory(std::string_view name) const;
  [[nodiscard]] Refusal missing(std::string_view name) const;
  [[nodiscard]] Refusal refusal_of(const StorageError& error);

  Usage usage_;
  Records records_{};
  /// Ordered by the end of the lease, so that expiry does not visit other names. Excludes names
  /// whose leases the storage ends.
  std::set<std::pair<MonotonicTime, std::string_view>> ends_{};
  InterfaceIndex index_{};
  std::uint64_t next_revision_;
  ChangeLog log_;
  LapsedNames lapsed_{};
  Storage& storage_;
  std::string storage_trouble_{};
};

}  // namespace rtpm::names
