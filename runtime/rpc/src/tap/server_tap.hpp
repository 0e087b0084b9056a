#pragma once

#include <atomic>
#include <deque>
#include <memory>
#include <string>
#include <vector>

#include "model/object_table.hpp"
#include "rtpm/rpc/tap.hpp"
#include "rtpm/rt/pi_mutex.hpp"
#include "tap/lane_tap.hpp"

namespace rtpm::rpc {

/// The tap of all lanes of a server.
/// @threads  like CallTap; add() and close(): the server
/// @realtime none
class ServerTap final : public CallTap {
 public:
  explicit ServerTap(const ObjectTable& objects) noexcept : objects_(&objects) {}
  ~ServerTap() override { switch_off(); }

  /// Adds a lane. Call before the first switch_on().
  void add(LaneTap& lane) { lanes_.push_back(&lane); }
  /// Switches the tap off for good, after the lanes have ended and before they and the objects are
  /// freed.
  void close() noexcept;

  expected<void, SetupError> switch_on(const TapConfig& config) override;
  void switch_off() noexcept override;
  bool is_on() const noexcept override { return is_on_.load(std::memory_order_relaxed); }
  std::optional<TappedCall> next() noexcept override;
  TapLosses losses() noexcept override;
  const std::vector<std::string>& objects() const noexcept override { return paths_; }

 private:
  [[nodiscard]] expected<void, SetupError> make_filter(const TapConfig& config);
  [[nodiscard]] bool wait_for_lanes() const noexcept;
  void disconnect() noexcept;

  /// Guards lanes_ and objects_ against close(), which another thread calls.
  mutable rt::PiMutex mutex_;
  const ObjectTable* objects_;     ///< Null once the server has stopped.
  std::vector<LaneTap*> lanes_{};  ///< Empty once the server has stopped.
  std::atomic<bool> is_on_{false};
  std::uint64_t generation_ = 0;
  std::vector<std::string> paths_{};
  TapFilter filter_{};
  std::deque<TapTrack> tracks_{};  ///< One track for each writer of each lane.
  std::uint64_t next_number_ = 1;  ///< The number of the next tap's first call.
  std::uint64_t busy_count_ = 0;   ///< Records that found all writers of a lane busy.
  std::size_t turn_ = 0;           ///< The track to read next.
  TapRing* held_ = nullptr;        ///< The ring of the record that next() returned.
  const TapRecord* held_record_ = nullptr;
};

}  // namespace rtpm::rpc
