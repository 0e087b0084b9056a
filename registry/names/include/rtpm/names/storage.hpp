#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/names/claim.hpp"
#include "rtpm/names/limits.hpp"
#include "rtpm/names/property.hpp"

namespace rtpm::names {

/// A stored binding.
struct StoredName {
  std::string name{};
  std::string url{};
  std::string interface {};
  Owner owner{};
  std::uint64_t revision = 0;  ///< Revision of its holder.
  std::uint64_t change = 0;    ///< Revision of its last change.
  std::uint64_t host = 0;      ///< See Claim::host.
  /// 0 if the name is permanent.
  Duration lease{};
  std::vector<Property> properties{};
  /// If the storage ends leases: the longest time that the name stays once no registry renews it; 0
  /// if the registry ends them.
  Duration stay{};

  [[nodiscard]] bool is_permanent() const noexcept { return lease == Duration{0}; }
  friend bool operator==(const StoredName&, const StoredName&) = default;
};

/// StoredName::host of a name bound from a loopback address at a registry on another host: the
/// discard prefix 100::/64 (RFC 6666), which no host has.
inline constexpr std::uint64_t kLoopbackElsewhere = 0x0100'0000'0000'0000;

/// A leased name whose lease ended without an unbind.
struct StoredLapse {
  StoredName name{};
  MonotonicTime ended{};
};

/// The content of a storage when a registry starts.
struct StoredContent {
  std::vector<StoredName> names{};
  std::vector<StoredLapse> lapsed{};
  /// Higher than every revision that was ever used.
  std::uint64_t first_revision = 1;
  /// Sentences about lost parts, and why nothing can be changed now; empty if everything is intact.
  std::vector<std::string> faults{};
  /// A number common to all registries with the same shared storage; 0 if it is not shared.
  std::uint64_t identity = 0;
  /// The location of a shared storage, for users; otherwise empty.
  std::string place{};
};

/// Why a change was not stored. It has not happened, except possibly with kUnreachable.
struct StorageError : SetupError {
  enum class Kind : std::uint8_t {
    kFull,      ///< No space is left.
    kReadOnly,  ///< It was found damaged, failed before, or was deleted.
    kFailed,
    kConflict,     ///< Another registry changed the name first.
    kUnreachable,  ///< A shared storage did not answer in time: the change may have happened.
  };
  Kind kind = Kind::kFailed;
};

/// One change of one name.
struct StoredChange {
  std::string_view name{};
  const StoredName* stored = nullptr;  ///< Null if the name is removed.
  std::uint64_t revision = 0;
  /// Whether the change must survive a power failure once commit() has returned, as for permanent
  /// names. Other changes only survive the end of the program.
  bool is_durable = false;
  /// The StoredName::change that it replaces; 0 if the name was not bound. A shared storage refuses
  /// the change if that is no longer the last one.
  std::uint64_t expected = 0;
  MonotonicTime deadline = kNever;  ///< Only used by a shared storage.
  /// When the lease ended, if the name is removed for that reason. A storage that is not shared
  /// keeps the name as lapsed until its next change.
  std::optional<MonotonicTime> lapsed{};
};

/// A change that a storage reports.
struct ReportedChange {
  std::string name{};
  std::uint64_t revision = 0;
  std::optional<StoredName> stored{};  ///< nullopt if the name was removed.
  bool has_lapsed = false;             ///< It was removed without an unbind.
};

/// The storage of a registry's names. The registry also has them in memory, and uses its storage
/// only for changes. This base class stores nothing: names are in memory only.
///
/// Several registries may share a storage. Then it orders the changes by its own revisions, ends
/// leases, and reports all changes; the registry's names only change with these reports.
/// @threads  load(), follow() and stop(): one. commit(), renew() and confirm(): the holder of the
///           registry's lock, which a storage releases while it waits. The rest: any
class Storage {
 public:
  /// The registry, as a shared storage sees it. The storage calls it on its own thread, without the
  /// lock.
  class Follower {
   public:
    Follower() = default;
    Follower(const Follower&) = delete;
    Follower& operator=(const Follower&) = delete;
    virtual ~Follower() = default;
    /// The registry's lock.
    virtual void lock() = 0;
    virtual void unlock() = 0;
    /// Reports changes of any registry, ordered by revision.
    virtual void on_changes(std::vector<ReportedChange> changes) = 0;
    /// Reports that changes were missed; `names` is the complete content at `revision`.
    /// `is_replaced`: the storage was restored or replaced, so reported revisions may be lost, and
    /// reused for other changes.
    virtual void on_restart(std::vector<StoredName> names, std::uint64_t revision,
                            bool is_replaced) = 0;
    /// Reports a sentence for the log: foreign content, or that the storage is unreachable.
    virtual void on_trouble(const std::string& sentence) = 0;
  };
  /// Releases the registry's lock in a scope in which the storage waits.
  class Unlocked {
   public:
    /// `follower` may be null: before follow() there is no lock.
    explicit Unlocked(Follower* follower) : follower_(follower) {
      if (follower_ != nullptr) follower_->unlock();
    }
    Unlocked(const Unlocked&) = delete;
    Unlocked& operator=(const Unlocked&) = delete;
    ~Unlocked() {
      if (follower_ != nullptr) follower_->lock();
    }

   private:
    Follower* follower_;
  };

  Storage() = default;
  Storage(const Storage&) = delete;
  Storage& operator=(const Storage&) = delete;
  virtual ~Storage() = default;

  /// Returns the complete content; called once, before anything else.
  /// @errors   the storage belongs to another program, is of a newer release, or is in use
  [[nodiscard]] virtual expected<StoredContent, SetupError> load();
  /// If the storage is shared, reports all changes after load() to `follower`, until stop().
  [[nodiscard]] virtual expected<void, SetupError> follow(Follower& follower);
  /// Ends follow(), and fails all operations in progress.
  virtual void stop() noexcept {}
  /// Whether every change is reported, including those of commit().
  [[nodiscard]] virtual bool reports_changes() const noexcept { return false; }

  /// Stores a change completely or not at all. Returns its revision: `change.revision`, unless a
  /// shared storage assigns its own revisions; a revision in `change.stored` that equals
  /// `change.revision` is then replaced, too.
  /// @errors   kConflict: the registry has the earlier change; check the rules again
  [[nodiscard]] virtual expected<std::uint64_t, StorageError> commit(const StoredChange& change);
  /// Starts a new lease of a name; `change.stored` differs from the stored name only in that. If
  /// the registry ends leases, there is nothing to store.
  /// @errors   those of commit()
  [[nodiscard]] virtual expected<void, StorageError> renew(const StoredChange& change);
  /// Checks that `change` is still the name's last change; if 0, that the name is not bound.
  /// @errors   those of commit()
  [[nodiscard]] virtual expected<void, StorageError> confirm(std::string_view name,
                                                             std::uint64_t change,
                                                             MonotonicTime deadline);
  /// Everything stored before that time is in the registry.
  [[nodiscard]] virtual MonotonicTime current_as_of() const noexcept { return kNever; }
  /// How long the registry's names may have been out of date; 0 if they are current.
  [[nodiscard]] Duration stale_for(MonotonicTime now) const noexcept;
};

/// Binds permanent names in a storage that no registry has open, replacing existing ones. Stops at
/// the first name that a registry would refuse.
/// @return the number of names bound
/// @errors   those of Storage::load(); the storage is damaged; the rules or limits refuse a name
[[nodiscard]] expected<std::size_t, SetupError> import_names(Storage& storage,
                                                             const std::vector<StoredName>& names,
                                                             const Limits& limits);

}  // namespace rtpm::names
