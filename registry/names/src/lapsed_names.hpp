#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <string_view>

#include "rtpm/base/time.hpp"
#include "rtpm/names/claim.hpp"

namespace rtpm::names {

struct Record;

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
  /// Limit of one host, so that none displaces those of others.
  static constexpr std::size_t kCountPerHostMax = 256;

  void add(const Record& record);
  /// The name is bound again.
  void erase(std::string_view name);
  /// Erases the name for its owner, or for any caller with the revision of its last holder.
  /// @return whether it was there and might be
  bool dismiss(std::string_view name, Owner owner, std::uint64_t holder_revision);
  /// By name.
  [[nodiscard]] const std::map<std::string, LapsedRecord, std::less<>>& all() const noexcept {
    return records_;
  }

 private:
  template <class Fits>
  void erase_oldest(Fits fits);

  std::map<std::string, LapsedRecord, std::less<>> records_{};
};

}  // namespace rtpm::names
