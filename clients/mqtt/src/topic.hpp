#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/events/event.hpp"

/// Converts between message topics and the types and sources of events.
namespace rtpm::mqtt {

/// Type and source of an event.
struct Origin {
  events::EventType type = 0;
  events::SourceId source = 0;
  friend bool operator==(const Origin&, const Origin&) = default;
};

/// Maps another client's topic to a type and source.
struct TopicMapping {
  std::string topic{};
  Origin origin{};
  friend bool operator==(const TopicMapping&, const TopicMapping&) = default;
};

/// "PREFIX/TYPE/SOURCE", both in decimal.
[[nodiscard]] std::string topic_of(std::string_view prefix, const Origin& origin);
/// The origin that a topic names; nullopt for other topics and invalid types.
[[nodiscard]] std::optional<Origin> origin_of(std::string_view prefix, std::string_view topic);

/// Parses "5" (all sources: nullopt) or "5/2".
/// @errors   what was expected, in words
struct WantedOrigin {
  events::EventType type = 0;
  std::optional<events::SourceId> source{};
};
[[nodiscard]] expected<WantedOrigin, SetupError> parse_wanted(std::string_view text);
/// Parses "lab/temperature=100/3".
/// @errors   what was expected, in words
[[nodiscard]] expected<TopicMapping, SetupError> parse_mapping(std::string_view text);
/// Whether messages may be published to the topic: not empty, no wildcard, at most 200 bytes.
[[nodiscard]] bool is_topic(std::string_view text) noexcept;

}  // namespace rtpm::mqtt
