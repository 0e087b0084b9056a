#pragma once

#include <cstdint>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/time.hpp"

namespace rtpm::etcd_store {

/// A key of a name, as the watch reported it.
struct KnownName {
  std::uint64_t revision = 0;    ///< Revision of its last change.
  std::uint64_t etcd_lease = 0;  ///< 0 if none.
  Duration lease{};              ///< Lease of the name.
  bool is_foreign = false;       ///< Its value was not written by a registry, so it is not a name.
  std::uint64_t value_hash = 0;
  friend bool operator==(const KnownName&, const KnownName&) = default;
};

using NameMap = std::map<std::string, KnownName, std::less<>>;

/// The keys of names, with the data that registries do not have; and leases that no longer have a
/// key.
/// @threads  any
class KnownNames {
 public:
  static constexpr std::size_t kUnusedLeaseCountMax = 4096;

  void put(const std::string& name, const KnownName& known) {
    const std::lock_guard lock(mutex_);
    names_.insert_or_assign(name, known);
  }
  void erase(const std::string& name) {
    const std::lock_guard lock(mutex_);
    names_.erase(name);
  }
  void replace(NameMap names) {
    const std::lock_guard lock(mutex_);
    names_ = std::move(names);
  }
  [[nodiscard]] std::optional<KnownName> find(std::string_view name) const {
    const std::lock_guard lock(mutex_);
    const auto found = names_.find(name);
    return found == names_.end() ? std::nullopt : std::optional(found->second);
  }
  [[nodiscard]] bool are(const NameMap& names) const {
    const std::lock_guard lock(mutex_);
    return names_ == names;
  }
  [[nodiscard]] std::size_t size() const {
    const std::lock_guard lock(mutex_);
    return names_.size();
  }

  /// Leases beyond the bound expire by themselves.
  void add_unused(std::uint64_t lease) {
    const std::lock_guard lock(mutex_);
    if (lease != 0 && unused_.size() < kUnusedLeaseCountMax) unused_.push_back(lease);
  }
  [[nodiscard]] std::optional<std::uint64_t> take_unused() {
    const std::lock_guard lock(mutex_);
    if (unused_.empty()) return std::nullopt;
    const std::uint64_t lease = unused_.back();
    unused_.pop_back();
    return lease;
  }

 private:
  mutable std::mutex mutex_;  ///< Plain: no real-time thread locks it.
  NameMap names_{};
  std::vector<std::uint64_t> unused_{};
};

}  // namespace rtpm::etcd_store
