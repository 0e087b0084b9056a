#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <string>

#include "rtpm/rpc/lane_table.hpp"
#include "rtpm/rpc/server.hpp"
#include "rtpm/rt/public_memory.hpp"

/// The server's side of its table of lanes.
namespace rtpm::rpc {

/// Creates a table with a slot for each lane of `config` at `hosts`. Tools ignore it until
/// open_to_readers().
/// @realtime set-up only
/// @errors   those of rt::PublicMemory::create()
[[nodiscard]] expected<rt::PublicMemory, SetupError> make_lane_table(const ServerConfig& config,
                                                                     std::string_view hosts,
                                                                     std::uint16_t port,
                                                                     bool is_open_to_network);
[[nodiscard]] LaneSlot& slot_of(const rt::PublicMemory& table, std::size_t lane) noexcept;
/// Makes the table visible to readers.
void open_to_readers(const rt::PublicMemory& table) noexcept;

/// Marks that the calling thread runs a method.
/// @realtime alloc-free, two stores
class BusyMark {
 public:
  /// Sets where the thread's marks are published from now on.
  static void show_at(std::atomic<std::int64_t>* place) noexcept;
  explicit BusyMark(MonotonicTime received) noexcept;
  BusyMark(const BusyMark&) = delete;
  BusyMark& operator=(const BusyMark&) = delete;
  ~BusyMark();
};

}  // namespace rtpm::rpc
