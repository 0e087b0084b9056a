#pragma once

#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "rtpm/incidents/book.hpp"

namespace rtpm::console {

/// The free space of a disk that the console writes to.
struct DiskSpace {
  std::string folder{};
  std::uint64_t free_bytes = 0;
};

/// Finds the causes of incidents in `console/state`, which is all that browsers see, too.
/// @threads  one
class CauseFinder {
 public:
  struct Found {
    std::vector<incidents::Cause> lasting{};
    std::vector<incidents::Cause> events{};  ///< Happened since the last find().
  };
  [[nodiscard]] Found find(const nlohmann::ordered_json& state, const std::vector<DiskSpace>& disks,
                           const incidents::Moment& moment);

 private:
  using Json = nlohmann::ordered_json;
  /// Whether `is_wrong` has held long enough to be more than one late answer.
  [[nodiscard]] bool lasts(const std::string& key, bool is_wrong, MonotonicTime now);
  void find_services(const Json& state, Found& found, MonotonicTime now);
  void find_devices(const Json& state, Found& found, const incidents::Moment& moment);
  void find_lease(const std::string& name, const Json& device, Found& found);
  void find_servers(const Json& state, Found& found);
  void find_recording(const Json& state, Found& found);
  void find_clock_jump(const incidents::Moment& moment, Found& found);

  bool is_settled_ = false;  ///< The console has had the time to find everything.
  std::map<std::string, MonotonicTime> wrong_since_{};  ///< Keyed by device or service.
  std::map<std::string, std::string> holders_{};        ///< Keyed by device.
  std::set<std::int64_t> own_servers_{};  ///< Processes of this laboratory seen alive.
  std::string recorded_file_{};
  std::uint64_t drop_count_ = 0;
  std::optional<incidents::Moment> before_{};
};

}  // namespace rtpm::console
