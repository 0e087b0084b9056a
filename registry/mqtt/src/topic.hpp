#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/expected.hpp"
#include "rtpm/events/event.hpp"

/// Topics of a broker, and the types and sources of events.
namespace rtpm::mqtt {

/// Of what type and source an event is.
struct Origin {
  events::EventType type = 0;
  events::SourceId source = 0;
  friend bool operator==(const Origin&, const Origin&) = default;
};

/// A topic that is no event's by itself, and what becomes of its messages.
struct TopicMapping {
  std::string topic{};
  Origin origin{};
  friend bool operator==(const TopicMapping&, const TopicMapping&) = default;
};

/// "PREFIX/TYPE/SOURCE", both in decimal.
[[nodiscard]] std::string topic_of(std::string_view prefix, const Origin& origin);
/// The reverse; nothing if it is no such topic, or its type none of a schema.
[[nodiscard]] std::optional<Origin> origin_of(std::string_view prefix, std::string_view topic);

/// "5" (all sources: nothing) or "5/2".
/// @errors   in words, what was expected
struct WantedOrigin {
  events::EventType type = 0;
  std::optional<events::SourceId> source{};
};
[[nodiscard]] expected<WantedOrigin, std::string> parse_wanted(std::string_view text);
/// "lab/temperature=100/3".
/// @errors   in words, what was expected
[[nodiscard]] expected<TopicMapping, std::string> parse_mapping(std::string_view text);
/// Whether messages may be published to it: not empty, no wildcard, at most 200 bytes.
[[nodiscard]] bool is_topic(std::string_view text) noexcept;

}  // namespace rtpm::mqtt
