#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/latest.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/rpc/counters.hpp"
#include "rtpm/rt/public_memory.hpp"

/// The lane state that every server publishes to other processes of the same user, in shared
/// memory: a header, followed by one slot per lane. `rtpm lanes` prints it. Numbers are in native
/// byte order. Any change to a struct here, or to ServerCounters, requires a new kLaneTableVersion.
namespace rtpm::rpc {

/// The name that rt::find_public_memory() takes.
inline constexpr std::string_view kLaneTableName = "lanes";
inline constexpr std::uint64_t kLaneTableMagic = 0x5345'4e41'4c4d'5052;  // "RPMLANES"
inline constexpr std::uint32_t kLaneTableVersion = 4;

/// The most threads of a lane: 64 static and 64 dynamic threads, and the receiving thread.
inline constexpr std::size_t kLaneThreadCountMax = 129;

/// The counts of a lane that is serving. A cycle lasts from receiving a frame until its answer is
/// written, including the method.
struct LaneSample {
  ServerCounters counters{};
  std::uint64_t cycle_count = 0;            ///< Frames received and handled.
  std::int64_t longest_cycle_ns = 0;        ///< The longest cycle.
  std::int64_t last_cycle_end_ns = 0;       ///< On CLOCK_MONOTONIC; 0 before the first.
  std::uint64_t queued_count = 0;           ///< Calls that are waiting for a thread.
  std::uint64_t open_call_count = 0;        ///< Deferred calls and streams that are open.
  std::uint64_t open_connection_count = 0;  ///< Open connections over TCP and shared memory.
  std::uint64_t pause_count = 0;            ///< Pauses to avoid throttling, see rt/budget.hpp.
};

/// One lane. Everything except the atomics is written before the table is published, and is
/// constant.
struct alignas(64) LaneSlot {
  std::array<char, 32> name{};  ///< Null-terminated.
  std::uint16_t band_low = 0;   ///< The lowest priority of the lane.
  std::uint16_t band_high = 0;
  std::uint16_t priority = 0;
  std::uint8_t wait = 0;      ///< A value of rt::WaitStrategy.
  std::uint8_t schedule = 0;  ///< A value of rt::Schedule.
  /// When each thread received the call that it runs; 0 if the thread is idle.
  std::array<std::atomic<std::int64_t>, kLaneThreadCountMax> busy_since_ns{};
  Latest<LaneSample> sample{};
};

struct alignas(64) LaneTableHeader {
  std::atomic<std::uint64_t> magic{0};  ///< Written last.
  std::uint32_t version = 0;
  /// Bytes from one slot to the next. The first slot follows this header.
  std::uint32_t slot_size = 0;
  std::uint32_t slot_count = 0;
  std::uint16_t port = 0;
  /// 1: other hosts reach the server, and it does not authenticate callers.
  std::uint16_t is_open_to_network = 0;
  std::int64_t created_ns = 0;         ///< On CLOCK_MONOTONIC.
  std::array<char, 64> server_name{};  ///< Null-terminated.
  std::array<char, 48> host{};         ///< Null-terminated.
};

static_assert(std::atomic<std::int64_t>::is_always_lock_free);

/// A reader's copy of a lane. Texts hold printable ASCII only.
struct LaneReading {
  std::string name{};
  int band_low = 0;
  int band_high = 0;
  int priority = 0;
  std::string wait{};            ///< "adaptive"; "unknown" if this program does not know the value.
  std::string schedule{};        ///< For example "fifo".
  std::uint32_t busy_count = 0;  ///< Threads that run methods.
  MonotonicTime busy_since{};    ///< When the longest-running call was received; 0 if none runs.
  /// nullopt before the first call.
  std::optional<LaneSample> sample{};
};

/// Another process's table of lanes.
/// @threads  one at a time
/// @realtime set-up only
class LaneTable {
 public:
  /// The tables of all servers that the caller may read. A table of another version is included,
  /// but shows no lanes: see is_known().
  [[nodiscard]] static std::vector<LaneTable> find();

  [[nodiscard]] int process_id() const noexcept { return view_.process_id(); }
  [[nodiscard]] bool is_alive() const noexcept { return view_.is_alive(); }
  /// Whether the table is complete and this program knows its version.
  [[nodiscard]] bool is_known() const noexcept { return slot_count_ > 0; }
  [[nodiscard]] std::uint32_t version() const noexcept { return version_; }
  [[nodiscard]] const std::string& server_name() const noexcept { return server_name_; }
  [[nodiscard]] const std::string& host() const noexcept { return host_; }
  [[nodiscard]] std::uint16_t port() const noexcept { return port_; }
  /// Whether other hosts reach the server, and it does not authenticate callers.
  [[nodiscard]] bool is_open_to_network() const noexcept { return is_open_to_network_; }
  /// The current state of the lanes, without the process's help.
  [[nodiscard]] std::vector<LaneReading> read() const;

 private:
  explicit LaneTable(rt::PublicView view);
  void check();

  rt::PublicView view_;
  std::uint32_t version_ = 0;
  std::uint32_t slot_count_ = 0;
  std::uint16_t port_ = 0;
  bool is_open_to_network_ = false;
  std::string server_name_{};
  std::string host_{};
};

}  // namespace rtpm::rpc
