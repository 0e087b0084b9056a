#pragma once

#include <cstddef>
#include <cstdint>
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
  std::uint32_t host = 0;      ///< Claim::host
  /// Of a leased one; 0: it is permanent.
  Duration lease{};
  std::vector<Property> properties{};

  [[nodiscard]] bool is_permanent() const noexcept { return lease == Duration{0}; }
  friend bool operator==(const StoredName&, const StoredName&) = default;
};

/// What a registry finds when it starts.
struct StoredContent {
  std::vector<StoredName> names{};
  /// Every revision that was ever used is below it.
  std::uint64_t first_revision = 1;
  /// What is lost, and why nothing can be changed; empty: all is sound. A sentence each.
  std::vector<std::string> faults{};
};

/// Why a change was not stored. It has not happened then.
struct StorageError : SetupError {
  enum class Kind : std::uint8_t {
    kFull,      ///< No space is left.
    kReadOnly,  ///< It was found damaged, or failed before.
    kFailed,
  };
  Kind kind = Kind::kFailed;
};

/// One change of one name.
struct StoredChange {
  std::string_view name{};
  const StoredName* stored = nullptr;  ///< Null: it goes.
  std::uint64_t revision = 0;
  /// It must outlast a power cut once commit() has returned: permanent names. Others outlast the
  /// end of the program.
  bool is_durable = false;
};

/// Where a registry keeps its names. The registry has them in memory, too, and asks its storage
/// only for changes; a shared one would add the changes of other registries.
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
  /// Stores a change as a whole or not at all.
  [[nodiscard]] virtual expected<void, StorageError> commit(const StoredChange& change) = 0;
};

/// Binds permanent names in a storage that no registry has open, replacing those that are there.
/// Stops at the first that a registry would refuse.
/// @return how many were bound
/// @errors   as Storage::load(); the storage is damaged; a name that the rules or limits refuse
[[nodiscard]] expected<std::size_t, SetupError> import_names(Storage& storage,
                                                             const std::vector<StoredName>& names,
                                                             const Limits& limits);

}  // namespace rtpm::names
