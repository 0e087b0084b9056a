#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <string_view>

#include "rtpm/base/time.hpp"
#include "rtpm/names/claim.hpp"

namespace rtpm::names {

/// A name whose lease ended without an unbind.
struct LapsedRecord {
  std::string name{};
  std::string url{};
  std::string interface {};
  Owner owner{};
  std::uint64_t revision = 0;
  std::uint64_t host = 0;
  MonotonicTime ended{};  ///< When its lease ended.
};

/// The latest names whose lease ended without an unbind.
/// @threads  one at a time
class LapsedNames {
 public:
  static constexpr std::size_t kCountMax = 1024;
  /// Limit per host, so that no host displaces another one's names.
  static constexpr std::size_t kCountPerHostMax = 256;

  /// @return the name dropped to make space; empty if none
  std::string add(LapsedRecord record);
  void erase(std::string_view name);
  /// Whether the name has lapsed and may be dismissed: by its owner, or by any caller with its last
  /// holder's revision.
  [[nodiscard]] bool may_dismiss(std::string_view name, Owner owner,
                                 std::uint64_t holder_revision) const;
  /// The lapsed names, keyed by name.
  [[nodiscard]] const std::map<std::string, LapsedRecord, std::less<>>& all() const noexcept {
    return records_;
  }

 private:
  template <class Fits>
  std::string erase_oldest(Fits fits);

  std::map<std::string, LapsedRecord, std::less<>> records_{};
};

}  // namespace rtpm::names
