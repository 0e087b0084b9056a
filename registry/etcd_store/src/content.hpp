#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "gateway.hpp"
#include "known_names.hpp"
#include "rtpm/names/storage.hpp"

namespace rtpm::etcd_store {

/// The keys of a cluster's names.
class Keys {
 public:
  explicit Keys(const std::string& prefix)
      : names_(prefix + "/names/"), fences_(prefix + "/fences/") {}
  /// The key range of all names, in etcd's form.
  [[nodiscard]] Json all() const;
  [[nodiscard]] std::string key_of(std::string_view name) const {
    return names_ + std::string(name);
  }
  /// The name of this key; nullopt if it is not the key of a name.
  [[nodiscard]] std::optional<std::string> name_of(std::string_view key) const;
  /// A key that changes with every unbind of the name, and of some other names.
  [[nodiscard]] std::string fence_of(std::string_view name) const;

 private:
  std::string names_;
  std::string fences_;
};

/// The etcd lease, in whole seconds, for the lease of a name.
[[nodiscard]] std::uint64_t seconds_of(Duration lease) noexcept;

/// A key and its value, decoded as a name.
struct ReadName {
  KnownName known{};
  std::optional<names::StoredName> stored{};  ///< nullopt if the value is foreign.
};
[[nodiscard]] ReadName read_name(const std::string& name, const KeyValue& key_value);

/// Everything that is stored at one revision.
struct Content {
  std::vector<names::StoredName> names{};
  NameMap known{};
  std::uint64_t revision = 0;
  std::size_t foreign_count = 0;  ///< Number of keys that are not names.
};
/// @param revision  the revision to read; 0 for the latest
/// @errors   kOutOfRange: the revision does not exist yet, or does not exist any more
[[nodiscard]] expected<Content, GatewayError> read_content(Gateway& gateway, const Keys& keys,
                                                           MonotonicTime deadline,
                                                           std::uint64_t revision = 0);

}  // namespace rtpm::etcd_store
