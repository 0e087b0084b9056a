#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/events/filter.hpp"
#include "rtpm/recording/mcap.hpp"

namespace rtpm::events {
class HubTypes;
}

namespace rtpm::capture {

/// A session of an experiment, as its recording states it.
/// @ownership a value
struct Session {
  std::string participant{};  ///< A code, such as "P07".
  std::string experiment{};
  std::string condition{};
  std::string notes{};  ///< May have several lines.
  friend bool operator==(const Session&, const Session&) = default;
};

/// The longest text of a session but its notes, and the longest notes, in bytes.
inline constexpr std::size_t kSessionTextSizeMax = 100;
inline constexpr std::size_t kSessionNotesSizeMax = 16 * 1024;
/// The usual pattern of a session's file.
inline constexpr std::string_view kSessionPattern =
    "{experiment}_{participant}_{condition}_{date}_{time}";

/// Names of a recording's metadata.
inline constexpr const char* kSessionMetadata = "rtpm.session";
inline constexpr const char* kVersionsMetadata = "rtpm.versions";

/// Whether a recording can state the session.
/// @errors   a text that is too long, is not UTF-8, or has control characters
[[nodiscard]] expected<void, SetupError> check(const Session& session);

/// The name that `pattern` makes for a session's file. {participant}, {experiment}, {condition},
/// {date} and {time} are replaced; '-' replaces characters of their values other than letters,
/// digits and '.'. An empty value takes its '_' with it. ".mcap" is added if it is missing.
/// @param utc_ns  date and time, since 1970
/// @errors   another field; a brace without its pair; nothing remains
[[nodiscard]] expected<std::string, SetupError> session_file(std::string_view pattern,
                                                             const Session& session,
                                                             std::uint64_t utc_ns);
/// `path`, or if a file has this name the first of run-2.mcap, run-3.mcap … that none has.
[[nodiscard]] std::string free_path(const std::string& path);

/// The metadata "rtpm.session".
[[nodiscard]] recording::Metadata session_metadata(const Session& session);
/// The session of a recording; nullopt if it states none. Texts of others may be in it.
[[nodiscard]] std::optional<Session> session_of(std::span<const recording::Metadata> metadata);
/// The metadata "rtpm.versions": RTPM's, and this host's name, kernel and machine.
[[nodiscard]] recording::Metadata versions_metadata();

/// Selects the events of devices and types. Trials of experiments and stops of all devices are
/// always among them.
/// @param devices  names
/// @param topics   types, such as "lab.Touched"
/// @return   everything if both are empty
/// @errors   the hub knows no such type; more than the hub takes
[[nodiscard]] expected<events::Filter, SetupError> selection_of(
    const events::HubTypes& types, std::span<const std::string> devices,
    std::span<const std::string> topics);

}  // namespace rtpm::capture
