#include "rtpm/capture/session.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <ctime>
#include <device_events.rtpm.events.hpp>
#include <filesystem>
#include <trial.rtpm.events.hpp>
#include <utility>

#include "rtpm/base/civil_time.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/events/hub_types.hpp"
#include "rtpm/gvd/device_event.hpp"
#include "rtpm/rt/host.hpp"

namespace rtpm::capture {
namespace {

constexpr std::string_view kEnding = ".mcap";

struct Field {
  const char* name;
  std::string Session::*text;
};
constexpr std::array kFields{Field{"participant", &Session::participant},
                             Field{"experiment", &Session::experiment},
                             Field{"condition", &Session::condition}};

expected<void, SetupError> check_text(const char* name, const std::string& text,
                                      std::size_t size_max, bool has_lines) {
  if (text.size() > size_max) {
    return setup_error(std::string("the session's ") + name + " is too long",
                       std::to_string(text.size()) + " bytes; at most " + std::to_string(size_max));
  }
  const std::string shown =
      has_lines ? printable_lines(text, kShownWhole) : printable(text, kShownWhole);
  if (shown == text) return {};
  return setup_error(std::string("the session's ") + name + " has characters that can't be shown",
                     "'" + printable(text) + "'", "use plain text");
}

/// Date and time as "20261124" and "091500".
std::string time_text(std::uint64_t utc_ns, const char* format) {
  const std::tm parts = civil_utc(utc_ns);
  std::array<char, 32> text{};
  std::strftime(text.data(), text.size(), format, &parts);
  return text.data();
}

std::string safe(std::string text) {
  for (char& c : text) {
    const bool is_plain = std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '.';
    if (!is_plain) c = '-';
  }
  return text;
}

expected<std::string, SetupError> value_of_field(std::string_view name, const Session& session,
                                                 std::uint64_t utc_ns) {
  for (const Field& field : kFields) {
    if (name == field.name) return safe(session.*field.text);
  }
  if (name == "date") return time_text(utc_ns, "%Y%m%d");
  if (name == "time") return time_text(utc_ns, "%H%M%S");
  return setup_error("the pattern has an unknown field {" + printable(name) + "}", "",
                     "it may have {participant}, {experiment}, {condition}, {date}, {time}");
}

events::Match match_of(events::EventType type) {
  return {.type = type, .type_mask = events::kWholeNumber};
}

}  // namespace

expected<void, SetupError> check(const Session& session) {
  for (const Field& field : kFields) {
    auto checked = check_text(field.name, session.*field.text, kSessionTextSizeMax, false);
    if (!checked) return checked;
  }
  return check_text("notes", session.notes, kSessionNotesSizeMax, true);
}

expected<std::string, SetupError> session_file(std::string_view pattern, const Session& session,
                                               std::uint64_t utc_ns) {
  std::string name;
  if (pattern.ends_with(kEnding)) pattern.remove_suffix(kEnding.size());
  for (std::size_t at = 0; at < pattern.size();) {
    if (pattern[at] == '}') return setup_error("the pattern has a '}' without its '{'");
    if (pattern[at] != '{') {
      name += pattern[at++];
      continue;
    }
    const std::size_t end = pattern.find('}', at);
    if (end == std::string_view::npos) {
      return setup_error("the pattern has a '{' without its '}'");
    }
    const auto value = value_of_field(pattern.substr(at + 1, end - at - 1), session, utc_ns);
    if (!value) return value;
    at = end + 1;
    name += *value;
    if (value->empty() && at < pattern.size() && pattern[at] == '_') ++at;
  }
  while (name.ends_with('_'))
    name.pop_back();
  if (name.empty() || name.ends_with('/')) {
    return setup_error("the pattern makes no name", "its fields are empty", "add {date}_{time}");
  }
  return name + std::string(kEnding);
}

std::string free_path(const std::string& path) {
  constexpr int kCountMax = 10'000;
  std::error_code error;
  const auto is_taken = [&](const std::string& name) {
    return std::filesystem::exists(std::filesystem::symlink_status(name, error));
  };
  const std::string stem =
      path.ends_with(kEnding) ? path.substr(0, path.size() - kEnding.size()) : path;
  std::string name = path;
  for (int i = 2; i < kCountMax && is_taken(name); ++i)
    name = stem + "-" + std::to_string(i) + path.substr(stem.size());
  return name;
}

recording::Metadata session_metadata(const Session& session) {
  recording::Metadata metadata{.name = kSessionMetadata, .values = {{"notes", session.notes}}};
  for (const Field& field : kFields)
    metadata.values[field.name] = session.*field.text;
  return metadata;
}

std::optional<Session> session_of(std::span<const recording::Metadata> metadata) {
  const auto found = std::ranges::find(metadata, kSessionMetadata, &recording::Metadata::name);
  if (found == metadata.end()) return std::nullopt;
  const auto text_of = [&](const char* name) {
    const auto value = found->values.find(name);
    return value == found->values.end() ? std::string{} : value->second;
  };
  Session session{.notes = text_of("notes")};
  for (const Field& field : kFields)
    session.*field.text = text_of(field.name);
  return session;
}

recording::Metadata versions_metadata() {
  return {.name = kVersionsMetadata,
          .values = {
              {"rtpm", RTPM_VERSION}, {"host", rt::host_name()}, {"kernel", rt::kernel_version()}}};
}

expected<events::Filter, SetupError> selection_of(const events::HubTypes& types,
                                                  std::span<const std::string> devices,
                                                  std::span<const std::string> topics) {
  if (devices.empty() && topics.empty()) return events::everything();
  std::vector<events::Match> matches{match_of(TrialEvent::kType),
                                     match_of(device::StopAllRequestedEvent::kType)};
  for (const std::string& device : devices) {
    matches.push_back({.source = gvd::source_of(device), .source_mask = events::kWholeNumber});
  }
  for (const std::string& topic : topics) {
    if (topic == TrialEvent::kDescriptor.name) continue;  // The hub may not know it yet.
    const auto found =
        std::ranges::find(types.list(), topic, [](const auto* type) { return type->name; });
    if (found == types.list().end()) {
      std::string names;
      for (const events::EventDescriptor* const type : types.list())
        names += (names.empty() ? "" : ", ") + printable(type->name);
      return setup_error("the hub knows no event " + printable(topic), "",
                         "it knows: " + printable(names, 1000));
    }
    matches.push_back(match_of((*found)->type));
  }
  if (matches.size() > events::kMatchCountMax) {
    return setup_error("too many devices and topics are selected", "",
                       "select fewer, or none to record all");
  }
  return events::listed(std::move(matches));
}

}  // namespace rtpm::capture
