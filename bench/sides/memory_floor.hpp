#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "rtpm/base/expected.hpp"
#include "sides/caller.hpp"
#include "sides/floor.hpp"

/// The raw floor of shared memory: rings of slots that hold RTPM's header and the payload, a futex
/// where a side blocks, and nothing else: no sizes, no checks, no sessions.
namespace rtpm::bench {

/// Memory for a raw server and its callers, which are processes of their own. Make it before the
/// server's process is forked, so that both have it. Ownership: unmaps at its end; callers and the
/// server's threads use it until then.   Set-up only.
class MemoryFloor {
 public:
  /// For lanes with so many callers each.   Errors: no memory left.
  [[nodiscard]] static expected<std::unique_ptr<MemoryFloor>, std::string> create(
      const std::vector<int>& caller_counts);
  ~MemoryFloor();
  MemoryFloor(const MemoryFloor&) = delete;
  MemoryFloor& operator=(const MemoryFloor&) = delete;

  /// Starts a thread per lane, which echo until the process ends, as start_floor_server() says.
  [[nodiscard]] expected<void, std::string> serve(const std::vector<FloorLaneConfig>& lanes,
                                                  rt::RealtimeMode realtime);
  /// The next caller of a lane.
  [[nodiscard]] std::unique_ptr<Caller> connect(std::size_t lane, const rt::WaitConfig& wait);

 private:
  struct Lane;
  struct Layout;
  MemoryFloor(Layout* layout, std::size_t size, std::vector<int> caller_counts)
      : layout_(layout), size_(size), caller_counts_(std::move(caller_counts)) {}

  Layout* layout_;
  std::size_t size_;
  std::vector<int> caller_counts_;
  std::vector<int> connected_counts_ = std::vector<int>(caller_counts_.size());
};

}  // namespace rtpm::bench
