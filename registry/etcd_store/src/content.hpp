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

/// Where a cluster has the names of registries.
class Keys {
 public:
  explicit Keys(const std::string& prefix)
      : names_(prefix + "/names/"), fences_(prefix + "/fences/") {}
  /// All names: a key and the end of a range, as etcd takes them.
  [[nodiscard]] Json all() const;
  [[nodiscard]] std::string key_of(std::string_view name) const {
    return names_ + std::string(name);
  }
  /// nullopt: it is no name's.
  [[nodiscard]] std::optional<std::string> name_of(std::string_view key) const;
  /// Changed by every unbind of the name, and of others.
  [[nodiscard]] std::string fence_of(std::string_view name) const;

 private:
  std::string names_;
  std::string fences_;
};

/// A key and its value as a name.
struct ReadName {
  KnownName known{};
  std::optional<names::StoredName> stored{};  ///< nullopt: it is foreign.
};
[[nodiscard]] ReadName read_name(const std::string& name, const KeyValue& key_value);

/// Everything that is stored, at one moment.
struct Content {
  std::vector<names::StoredName> names{};
  NameMap known{};
  std::uint64_t revision = 0;
  std::size_t foreign_count = 0;  ///< Keys that are no names.
};
/// @param revision  whose content is read; 0: the last one's
/// @errors   kOutOfRange: there is no such revision yet, or none any more
[[nodiscard]] expected<Content, GatewayError> read_content(Gateway& gateway, const Keys& keys,
                                                           MonotonicTime deadline,
                                                           std::uint64_t revision = 0);

}  // namespace rtpm::etcd_store
