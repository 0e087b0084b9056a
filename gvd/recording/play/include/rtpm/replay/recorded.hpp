#pragma once

#include <cstddef>
#include <cstdint>
#include <device.rtpm.hpp>
#include <optional>
#include <string>
#include <vector>

#include "rtpm/base/priority.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/events/event.hpp"
#include "rtpm/recording/file_reader.hpp"

/// Recorded devices and events, read and played.
namespace rtpm::replay {

/// A recorded device.
/// @ownership a value
struct RecordedDevice {
  std::string name;                      ///< "lab/arm0".
  std::vector<std::byte> description{};  ///< A finished Description.
  std::vector<device::Sample> samples{};
  std::vector<Duration> times{};  ///< Times of the samples since the recording's start, ascending.
};

/// The source of recorded events.
/// @ownership a value
struct RecordedSource {
  std::string topic;
  std::string type_name{};  ///< Such as "lab.Touched"; empty if unknown.
  events::EventType type = 0;
  events::SourceId source = 0;
  std::uint64_t schema_id = 0;
  Priority priority{};
  std::string device{};  ///< The device's name, if a device pushed the events.
};

/// One recorded event.
/// @ownership a value
struct RecordedEvent {
  std::size_t source = 0;  ///< Index in Recorded::sources.
  Duration at{};           ///< Time since the recording's start.
  std::size_t offset = 0;  ///< Offset of its payload in Recorded::payloads.
  std::size_t size = 0;
};

/// The contents of a recording that are played.
/// @ownership a value
struct Recorded {
  Duration length{};  ///< The time from the first sample or event to the last one.
  std::vector<RecordedDevice> devices{};
  std::vector<RecordedSource> sources{};
  std::vector<RecordedEvent> events{};  ///< In order of time.
  std::vector<std::byte> payloads{};
  /// Messages about omissions and corrections: malformed messages, a clock that jumps.
  std::vector<std::string> notes{};
};

/// Selects the part of a recording to read.
struct Selection {
  std::vector<std::string> devices{};  ///< Names of devices; empty for all.
  std::vector<std::string> topics{};   ///< The events' topics; empty for all.
  Duration from{0};                    ///< Time since the file's first message.
  std::optional<Duration> to{};
};

/// The most bytes of samples and payloads that load() reads; beyond it, the error names the remedy.
inline constexpr std::size_t kLoadByteMax = std::size_t{1} << 30;
/// The longest pause without any record; longer ones are shortened to kPauseLeft.
inline constexpr Duration kPauseMax = std::chrono::minutes{1};
inline constexpr Duration kPauseLeft = std::chrono::seconds{1};

/// Reads the devices and events of a recording that rtpm::capture wrote. A message is played at its
/// publish time, which is the origin's, even if it reached the recorder late.
/// @realtime set-up only
/// @errors   those of recording::FileReader::open(), with the remedy for a truncated file · no
///           device and no event · an unknown device or topic · one recorded with another version
///           of its schema · more than kLoadByteMax · stopped
[[nodiscard]] expected<Recorded, SetupError> load(const std::string& path,
                                                  const Selection& selection = {},
                                                  const recording::Progress& progress = {});

}  // namespace rtpm::replay
