#include "topic.hpp"

#include <charconv>

namespace rtpm::mqtt {
namespace {

constexpr std::size_t kTopicSizeMax = 200;

std::optional<std::uint32_t> number_of(std::string_view text) {
  std::uint32_t value = 0;
  const char* const end = text.data() + text.size();
  const auto read = std::from_chars(text.data(), end, value);
  // Only one spelling is allowed, so that each event has one topic.
  const bool is_plain = text == "0" || (!text.empty() && text[0] != '0');
  if (read.ec != std::errc{} || read.ptr != end || !is_plain) return std::nullopt;
  return value;
}

std::optional<Origin> parse_origin(std::string_view text) {
  const std::size_t slash = text.find('/');
  if (slash == std::string_view::npos) return std::nullopt;
  const auto type = number_of(text.substr(0, slash));
  const auto source = number_of(text.substr(slash + 1));
  if (!type || !source || *type == 0 || *type > events::kEventTypeMax) return std::nullopt;
  return Origin{*type, *source};
}

}  // namespace

std::string topic_of(std::string_view prefix, const Origin& origin) {
  return std::string(prefix) + "/" + std::to_string(origin.type) + "/" +
         std::to_string(origin.source);
}

std::optional<Origin> origin_of(std::string_view prefix, std::string_view topic) {
  if (!topic.starts_with(prefix) || topic.size() <= prefix.size() || topic[prefix.size()] != '/') {
    return std::nullopt;
  }
  return parse_origin(topic.substr(prefix.size() + 1));
}

expected<WantedOrigin, SetupError> parse_wanted(std::string_view text) {
  if (const auto both = parse_origin(text)) return WantedOrigin{both->type, both->source};
  const auto type = number_of(text);
  if (type && *type != 0 && *type <= events::kEventTypeMax) {
    return WantedOrigin{*type, std::nullopt};
  }
  return setup_error("'" + std::string(text) + "' is no type (\"5\") or type and source (\"5/2\")");
}

expected<TopicMapping, SetupError> parse_mapping(std::string_view text) {
  const std::size_t equals = text.rfind('=');
  if (equals != std::string_view::npos && is_topic(text.substr(0, equals))) {
    if (const auto origin = parse_origin(text.substr(equals + 1))) {
      return TopicMapping{std::string(text.substr(0, equals)), *origin};
    }
  }
  return setup_error("'" + std::string(text) +
                     "' is no topic with its type and source (\"lab/temperature=100/3\")");
}

bool is_topic(std::string_view text) noexcept {
  return !text.empty() && text.size() <= kTopicSizeMax &&
         text.find_first_of(std::string_view("+#\0", 3)) == std::string_view::npos;
}

}  // namespace rtpm::mqtt
