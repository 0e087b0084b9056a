#pragma once

#include <cstddef>
#include <cstdint>
#include <unordered_map>
#include <vector>

#include "model/record.hpp"
#include "rtpm/names/claim.hpp"
#include "rtpm/names/limits.hpp"
#include "rtpm/names/outcome.hpp"

namespace rtpm::names {

/// Counts names, owners and bytes, in total, per owner and per host, and enforces the limits.
class Usage {
 public:
  explicit Usage(const Limits& limits) noexcept : limits_(limits) {}

  void add(const Record& record);
  void remove(const Record& record);
  /// The limit that the claim exceeds, not counting `held`, the record to be replaced, if any;
  /// kDone if none.
  [[nodiscard]] Outcome check(const Claim& claim, const Record* held) const;

  /// The number of names and owners of a host.
  struct HostUse {
    std::uint64_t host = 0;
    std::size_t name_count = 0;
    std::size_t owner_count = 0;
  };
  /// The `count_max` hosts with the most names, in descending order.
  [[nodiscard]] std::vector<HostUse> hosts(std::size_t count_max) const;
  /// The number of owners of names.
  [[nodiscard]] std::size_t owner_count() const noexcept { return owners_.size(); }
  [[nodiscard]] const Limits& limits() const noexcept { return limits_; }

 private:
  struct OwnerUse {
    std::size_t name_count = 0;
    std::size_t property_byte_count = 0;
  };
  struct Host {
    std::size_t name_count = 0;
    std::unordered_map<std::uint64_t, std::size_t> count_of_owner{};
  };
  [[nodiscard]] Outcome check_properties(const Claim& claim, const Record* held) const;
  [[nodiscard]] Outcome check_host(const Claim& claim, const Record* held) const;

  Limits limits_;
  std::size_t name_count_ = 0;
  std::size_t property_byte_count_ = 0;
  std::unordered_map<std::uint64_t, OwnerUse> owners_{};
  std::unordered_map<std::uint64_t, Host> hosts_{};  ///< The hosts that hold names.
};

}  // namespace rtpm::names
