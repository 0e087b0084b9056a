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

/// A binding as a storage keeps it.
struct StoredName {
  std::string name{};
  std::string url{};
  std::string interface {};
  Owner owner{};
  std::uint64_t revision = 0;  ///< Revision of its holder.
  std::uint64_t change = 0;    ///< Revision of its last change.
  std::uint64_t host = 0;      ///< Claim::host
  /// 0 if the name is permanent.
  Duration lease{};
  std::vector<Property> properties{};

  [[nodiscard]] bool is_permanent() const noexcept { return lease == Duration{0}; }
  friend bool operator==(const StoredName&, const StoredName&) = default;
};

/// StoredName::host of a name that was bound by a loopback address at a registry on another host:
/// the discard prefix 100::/64 (RFC 6666), which no host has.
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
  /// Every revision that was ever used is lower.
  std::uint64_t first_revision = 1;
  /// The lost parts, and why nothing can be changed now, a sentence each; empty if all is sound.
  std::vector<std::string> faults{};
};

/// Why a change was not stored. Except with kUnreachable, it has not happened.
struct StorageError : SetupError {
  enum class Kind : std::uint8_t {
    kFull,      ///< No space is left.
    kReadOnly,  ///< It was found damaged, failed before, or was deleted.
    kFailed,
    kConflict,     ///< Another registry changed it first: see `revision`.
    kUnreachable,  ///< A shared storage did not answer in time: the change may have happened.
  };
  Kind kind = Kind::kFailed;
  /// kConflict: the revision of the change that came first; try again once the follower has it.
  std::uint64_t revision = 0;
};

/// One change of one name.
struct StoredChange {
  std::string_view name{};
  const StoredName* stored = nullptr;  ///< Null if the name is removed.
  std::uint64_t revision = 0;
  /// Whether the change must survive a power cut once commit() has returned, as for permanent
  /// names. Other changes survive the end of the program only.
  bool is_durable = false;
  /// The StoredName::change that it replaces; 0 if the name was not bound. A shared storage
  /// refuses the change if this is no longer the last one.
  std::uint64_t expected = 0;
  MonotonicTime deadline = kNever;  ///< Used by a shared storage only.
  /// Time at which the lease ended, if the name is removed because of that. A storage that is not
  /// shared keeps the name as lapsed until its next change.
  std::optional<MonotonicTime> lapsed{};
};

/// The storage of a registry's names. The registry also has them in memory, and asks its storage
/// only for changes.
/// @threads  one at a time
class Storage {
 public:
  Storage() = default;
  Storage(const Storage&) = delete;
  Storage& operator=(const Storage&) = delete;
  virtual ~Storage() = default;

  /// Returns everything that is stored; called once, before anything else.
  /// @errors   the storage is another program's, of a newer release, or in use
  [[nodiscard]] virtual expected<StoredContent, SetupError> load() = 0;
  /// Stores a change as a whole or not at all. Returns its revision: `change.revision`, but a
  /// shared storage assigns its own, also to a stored revision that equals `change.revision`.
  [[nodiscard]] virtual expected<std::uint64_t, StorageError> commit(
      const StoredChange& change) = 0;
};

/// A change in a shared storage.
struct SharedChange {
  std::string name{};
  std::uint64_t revision = 0;
  std::optional<StoredName> stored{};  ///< nullopt if the name was removed.
  bool has_lapsed = false;             ///< It was removed without an unbind.
};

/// A storage that several registries use at the same time. It orders their changes by its own
/// revisions, and ends the leases of names.
/// @threads  load(), follow() and stop() from one; the rest any, several at once
class SharedStorage : public Storage {
 public:
  /// The registry's receiver of changes. The storage calls it on its own thread.
  class Follower {
   public:
    Follower() = default;
    Follower(const Follower&) = delete;
    Follower& operator=(const Follower&) = delete;
    virtual ~Follower() = default;
    /// Changes of any registry, in the order of their revisions.
    virtual void on_changes(std::vector<SharedChange> changes) = 0;
    /// Changes were missed; `names` is everything that is stored, as of `revision`. `is_replaced`:
    /// the storage was restored or replaced, so revisions that were reported may be lost, and may
    /// be used again for other changes.
    virtual void on_restart(std::vector<StoredName> names, std::uint64_t revision,
                            bool is_replaced) = 0;
    /// Everything that was stored before `as_of` has been reported.
    virtual void on_current(MonotonicTime as_of) = 0;
    /// A sentence for the log: which content is foreign, or that the storage is unreachable.
    virtual void on_trouble(const std::string& sentence) = 0;
  };

  /// Reports all changes after load() to `follower`, until stop().
  [[nodiscard]] virtual expected<void, SetupError> follow(Follower& follower) = 0;
  /// Ends follow(), and fails all operations under way.
  virtual void stop() noexcept = 0;
  /// Checks that `change` is still the last change of the name; if 0, that it is not bound.
  /// @errors   kConflict: the last change is another
  [[nodiscard]] virtual expected<void, StorageError> confirm(std::string_view name,
                                                             std::uint64_t change,
                                                             MonotonicTime deadline) = 0;
  /// Confirms like confirm(), and starts another lease, as long as the stored one, if the name has
  /// a lease.
  /// @errors   kConflict: it has changed, or its lease has ended
  [[nodiscard]] virtual expected<void, StorageError> renew(std::string_view name,
                                                           std::uint64_t change,
                                                           MonotonicTime deadline) = 0;
  /// The longest time that a name with this lease stays after its last renewal.
  [[nodiscard]] virtual Duration stay_of(Duration lease) const noexcept = 0;
  /// A number that all registries with this storage share, and no other storage has. Call it after
  /// load().
  [[nodiscard]] virtual std::uint64_t identity() const noexcept = 0;
  /// Its location, in a form for users.
  [[nodiscard]] virtual std::string place() const = 0;
};

/// Binds permanent names in a storage that no registry has open, replacing existing ones. Stops at
/// the first name that a registry would refuse.
/// @return the number of names that were bound
/// @errors   as Storage::load(); the storage is damaged; a name that the rules or limits refuse
[[nodiscard]] expected<std::size_t, SetupError> import_names(Storage& storage,
                                                             const std::vector<StoredName>& names,
                                                             const Limits& limits);

}  // namespace rtpm::names
