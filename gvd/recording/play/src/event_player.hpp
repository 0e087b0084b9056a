#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "rtpm/events/hub_types.hpp"
#include "rtpm/events/supplier.hpp"
#include "rtpm/replay/playback.hpp"
#include "rtpm/replay/recorded.hpp"
#include "rtpm/rpc/node.hpp"

namespace rtpm::replay {

/// The name under which a recorded device is played.
[[nodiscard]] std::string played_name(const std::string& folder, const std::string& recorded_name);

/// Pushes recorded events to a hub in order, with their type, payload and schema, and also their
/// source, unless the device is renamed. Sequence numbers are new, without the recording's gaps,
/// and origins are on this host's clock, so filters and consumers work as with a live supplier.
/// @ownership refers to its node and recording, which must outlive it
/// @threads  play() on one, the counts on any
class EventPlayer {
 public:
  /// @param folder  see played_name()
  /// @errors   no hub answers there
  [[nodiscard]] static expected<std::unique_ptr<EventPlayer>, SetupError> create(
      rpc::Node& node, const std::string& hub, const Recorded& recorded, const std::string& folder);

  /// Pushes the events from `from` on, each at its time, until the turn ends.
  void play(Duration from, const Turn& turn);

  [[nodiscard]] std::uint64_t pushed_count() const noexcept {
    return pushed_count_.load(std::memory_order_relaxed);
  }
  [[nodiscard]] std::uint64_t failed_count() const noexcept {
    return failed_count_.load(std::memory_order_relaxed);
  }
  /// Names of types unknown to the hub, so that filters can't read their fields.
  [[nodiscard]] const std::vector<std::string>& unknown_types() const noexcept {
    return unknown_types_;
  }

 private:
  EventPlayer(const Recorded& recorded, events::HubTypes types) noexcept
      : recorded_(recorded), types_(std::move(types)) {}

  void push(const RecordedEvent& event, MonotonicTime origin);

  const Recorded& recorded_;
  events::HubTypes types_;
  std::map<Priority, std::unique_ptr<events::Supplier>> suppliers_{};
  std::vector<events::SourceId> sources_{};  ///< Indexed by RecordedEvent::source.
  std::vector<std::string> unknown_types_{};
  std::atomic<std::uint64_t> pushed_count_{0};
  std::atomic<std::uint64_t> failed_count_{0};
};

}  // namespace rtpm::replay
