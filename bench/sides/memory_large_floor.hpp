#pragma once

#include <memory>
#include <string>

#include "rtpm/base/expected.hpp"
#include "sides/caller.hpp"
#include "sides/floor.hpp"

/// The raw floor of shared memory for other payloads than the usual: one buffer each way, of RTPM's
/// header and the payload, copied in by one side and out by the other.
namespace rtpm::bench {

/// Memory for a raw server and one caller, each a process of its own. Make it before the server's
/// process is forked. Ownership: unmaps at its end; the caller and the server's thread use it until
/// then.   Set-up only.
class MemoryLargeFloor {
 public:
  /// Errors: no memory left.
  [[nodiscard]] static expected<std::unique_ptr<MemoryLargeFloor>, std::string> create(
      std::size_t payload_size);
  ~MemoryLargeFloor();
  MemoryLargeFloor(const MemoryLargeFloor&) = delete;
  MemoryLargeFloor& operator=(const MemoryLargeFloor&) = delete;

  /// Starts the lane's thread, which echoes until the process ends.
  [[nodiscard]] expected<void, std::string> serve(const FloorLaneConfig& lane,
                                                  rt::RealtimeMode realtime);
  /// The one caller.
  [[nodiscard]] std::unique_ptr<Caller> connect(const rt::WaitConfig& wait);

 private:
  struct Layout;
  MemoryLargeFloor(Layout* layout, std::size_t frame_size, std::size_t size)
      : layout_(layout), frame_size_(frame_size), size_(size) {}

  Layout* layout_;
  std::size_t frame_size_;
  std::size_t size_;
};

}  // namespace rtpm::bench
