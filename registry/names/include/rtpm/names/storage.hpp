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
  std::uint64_t revision = 0;  ///< Of its holder,
  std::uint64_t change = 0;    ///< and of its last change.
  std::uint64_t host = 0;      ///< Claim::host
  /// Of a leased one; 0: it is permanent.
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

/// What a registry finds when it starts.
struct StoredContent {
  std::vector<StoredName> names{};
  std::vector<StoredLapse> lapsed{};
  /// Every revision that was ever used is below it.
  std::uint64_t first_revision = 1;
  /// The lost parts, and why nothing can be changed now; empty: all is sound. A sentence each.
  std::vector<std::string> faults{};
};

/// Why a change was not stored. It has not happened then, but for kUnreachable.
struct StorageError : SetupError {
  enum class Kind : std::uint8_t {
    kFull,      ///< No space is left.
    kReadOnly,  ///< It was found damaged, failed before, or was deleted.
    kFailed,
    kConflict,     ///< Another registry was first: see `revision`.
    kUnreachable,  ///< A shared one did not answer in time: it may have happened, or not.
  };
  Kind kind = Kind::kFailed;
  /// Of kConflict: of the change that was first, which the follower is told; then try again.
  std::uint64_t revision = 0;
};

/// One change of one name.
struct StoredChange {
  std::string_view name{};
  const StoredName* stored = nullptr;  ///< Null: it goes.
  std::uint64_t revision = 0;
  /// It must outlast a power cut once commit() has returned: permanent names. Others outlast the
  /// end of the program.
  bool is_durable = false;
  /// StoredName::change that it replaces; 0: the name was not bound. A shared storage refuses the
  /// change if that is not so any more.
  std::uint64_t expected = 0;
  MonotonicTime deadline = kNever;  ///< Of a shared one.
  /// When the lease of a name that goes ended, of one whose lease did: a storage that is not shared
  /// keeps it as lapsed until the next change of the name.
  std::optional<MonotonicTime> lapsed{};
};

/// Where a registry keeps its names. The registry has them in memory, too, and asks its storage
/// only for changes.
/// @threads  one at a time
class Storage {
 public:
  Storage() = default;
  Storage(const Storage&) = delete;
  Storage& operator=(const Storage&) = delete;
  virtual ~Storage() = default;

  /// Everything that is stored; once, first.
  /// @errors   it is another program's, of a newer release, or in use
  [[nodiscard]] virtual expected<StoredContent, SetupError> load() = 0;
  /// Stores a change as a whole or not at all. Returns its revision: `change.revision`, but a
  /// shared one gives its own, also to a stored revision that equals `change.revision`.
  [[nodiscard]] virtual expected<std::uint64_t, StorageError> commit(
      const StoredChange& change) = 0;
};

/// A change that a shared storage has.
struct SharedChange {
  std::string name{};
  std::uint64_t revision = 0;
  std::optional<StoredName> stored{};  ///< nullopt: it has gone.
  bool has_lapsed = false;             ///< It has gone without an unbind.
};

/// A storage that several registries have at once. It orders their changes by revisions of its own,
/// and ends the leases of names.
/// @threads  load(), follow() and stop() from one; the rest any, several at once
class SharedStorage : public Storage {
 public:
  /// What it tells a registry, on a thread of its own.
  class Follower {
   public:
    Follower() = default;
    Follower(const Follower&) = delete;
    Follower& operator=(const Follower&) = delete;
    virtual ~Follower() = default;
    /// Changes, in the order of their revisions, whoever made them.
    virtual void on_changes(std::vector<SharedChange> changes) = 0;
    /// Changes were missed: everything that is stored, as of `revision`. `is_replaced`: the storage
    /// was restored or replaced, so that revisions that were told may have been forgotten, and come
    /// again for other changes.
    virtual void on_restart(std::vector<StoredName> names, std::uint64_t revision,
                            bool is_replaced) = 0;
    /// Everything that was stored before `as_of` has been told.
    virtual void on_current(MonotonicTime as_of) = 0;
    /// A sentence for the log: what of it is foreign, or that it is not reached.
    virtual void on_trouble(const std::string& sentence) = 0;
  };

  /// Tells `follower` all changes after load(), until stop().
  [[nodiscard]] virtual expected<void, SetupError> follow(Follower& follower) = 0;
  /// Ends that, and fails what is under way.
  virtual void stop() noexcept = 0;
  /// Whether the last change of the name still is `change`; 0: it is not bound.
  /// @errors   kConflict: it is another
  [[nodiscard]] virtual expected<void, StorageError> confirm(std::string_view name,
                                                             std::uint64_t change,
                                                             MonotonicTime deadline) = 0;
  /// As confirm(), and begins another lease, as long as the stored one, if the name has any.
  /// @errors   kConflict: it has changed, or its lease has ended
  [[nodiscard]] virtual expected<void, StorageError> renew(std::string_view name,
                                                           std::uint64_t change,
                                                           MonotonicTime deadline) = 0;
  /// How long a name with this lease at most stays after its last renewal.
  [[nodiscard]] virtual Duration stay_of(Duration lease) const noexcept = 0;
  /// The same for all registries that have this storage, and for no other storage. After load().
  [[nodiscard]] virtual std::uint64_t identity() const noexcept = 0;
  /// Where it is, for people.
  [[nodiscard]] virtual std::string place() const = 0;
};

/// Binds permanent names in a storage that no registry has open, replacing those that are there.
/// Stops at the first that a registry would refuse.
/// @return how many were bound
/// @errors   as Storage::load(); the storage is damaged; a name that the rules or limits refuse
[[nodiscard]] expected<std::size_t, SetupError> import_names(Storage& storage,
                                                             const std::vector<StoredName>& names,
                                                             const Limits& limits);

}  // namespace rtpm::names
