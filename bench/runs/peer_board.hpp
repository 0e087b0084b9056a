#pragma once

#include <semaphore.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "rtpm/base/expected.hpp"
#include "runs/turn.hpp"
#include "settings.hpp"

/// The memory that rtpm-bench and the programs of a peer share while the peer is measured. Each
/// peer has a program of its own, rtpm-peer-NAME, so that its libraries are not in rtpm-bench and a
/// peer that is not built is just missing. The program runs as a server and as a client; the board
/// has their instructions, and the client's measurements.
namespace rtpm::bench {

/// More than any turn has.
inline constexpr std::size_t kPeerSampleMax = 65'536;
/// The lane of the measured caller, and the one of the callers of low priority.
inline constexpr std::size_t kPeerLaneCount = 2;

template <std::size_t Size>
struct BoardText {
  std::array<char, Size> bytes{};

  /// A text that is too long is cut.
  void set(std::string_view text) noexcept {
    const std::size_t size = text.copy(bytes.data(), Size - 1);
    bytes[size] = '\0';
  }
  [[nodiscard]] std::string_view get() const noexcept { return bytes.data(); }
};

/// How a peer is set up: written by rtpm-bench before its programs start, except for the addresses,
/// which the server writes before the client starts.
struct PeerSetting {
  BoardText<32> transport{};
  BoardText<64> folder{};  ///< Holds sockets and configuration; removed after the run.
  Placement placement{};
  rt::RealtimeMode realtime = rt::RealtimeMode::kPrefer;
  std::int32_t low_caller_count = 0;  ///< If above 0, the server has a second lane.
  std::int64_t work_ns = 0;           ///< How long a call of low priority computes.
  std::int32_t consumer_count = 0;    ///< Consumers of events.
  std::array<BoardText<2048>, kPeerLaneCount> addresses{};
};

struct PeerBoard {
  PeerSetting setting;
  sem_t asked;     ///< The client shall run `plan`.
  sem_t answered;  ///< The client did, and wrote the fields below.
  TurnPlan plan;
  BoardText<512> error;  ///< Empty if all went well.
  std::uint64_t high_count = 0;
  std::uint64_t low_count = 0;
  std::uint64_t missing_count = 0;  ///< Deliveries of events that did not come in time.
  std::array<std::int64_t, kPeerSampleMax> high_ns;
  std::array<std::int64_t, kPeerSampleMax> low_ns;

  /// Client: waits for the next plan, however long that takes.
  void wait_for_plan() noexcept;
  /// rtpm-bench: lets the client run the plan; false if it did not within `patience`.
  [[nodiscard]] bool run_plan(Duration patience) noexcept;
};

/// A board in memory that a started program can map, too.
/// Ownership: unmaps at its end.   Set-up only.
class SharedBoard {
 public:
  [[nodiscard]] static expected<SharedBoard, std::string> create();
  /// The board that another process created and handed on as an open file.
  [[nodiscard]] static expected<SharedBoard, std::string> open(int file);
  SharedBoard(SharedBoard&& other) noexcept;
  SharedBoard& operator=(SharedBoard&&) = delete;
  ~SharedBoard();

  PeerBoard* operator->() const noexcept { return board_; }
  /// Stays open in programs that this process starts.
  [[nodiscard]] int file() const noexcept { return file_; }

 private:
  SharedBoard(int file, PeerBoard* board) noexcept : file_(file), board_(board) {}
  int file_;
  PeerBoard* board_;
};

}  // namespace rtpm::bench
