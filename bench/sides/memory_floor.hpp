#pragma once

#include <memory>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "sides/floor.hpp"

/// The raw floor of shared memory: rings of slots that hold RTPM's header and the payload, a futex
/// where a side blocks, and nothing else: no sizes, no checks, no sessions.
namespace rtpm::bench {

/// Memory for a raw server and its callers, which are processes of their own. Make it before the
/// server's process is forked, so that both have it.
/// @lifetime callers and the server's threads use it
/// @realtime set-up only
class MemoryFloor {
 public:
  /// Makes a lane per entry, with that many callers. Rings have RTPM's size; those of unusual
  /// payloads have one slot.
  /// @errors no memory left
  [[nodiscard]] static Outcome<std::unique_ptr<MemoryFloor>> create(
      const std::vector<int>& caller_counts, std::size_t payload_size);
  ~MemoryFloor();
  MemoryFloor(const MemoryFloor&) = delete;
  MemoryFloor& operator=(const MemoryFloor&) = delete;

  /// Starts a thread per lane, which echoes until the process ends, like start_floor_server().
  [[nodiscard]] Outcome<> serve(const std::vector<FloorLaneConfig>& lanes,
                                rt::RealtimeMode realtime);
  /// The next caller of a lane.
  [[nodiscard]] Call connect(std::size_t lane, const rt::WaitConfig& wait);

 private:
  struct Lane {
    std::byte* bed;
    std::vector<MutableBytes> paths{};
    std::size_t connected_count = 0;
  };
  MemoryFloor(const std::vector<int>& caller_counts, std::size_t payload_size);

  std::size_t frame_size_;
  std::size_t size_ = 0;
  std::byte* memory_ = nullptr;
  std::vector<Lane> lanes_{};
};

}  // namespace rtpm::bench
