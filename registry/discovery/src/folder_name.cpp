#include "folder_name.hpp"

#include <charconv>

#include "rtpm/discovery/scope.hpp"
#include "rtpm/wire/url.hpp"

namespace rtpm::discovery {
namespace {

constexpr std::string_view kRegistry = "registry";
constexpr std::string_view kNames = "names";

/// Cuts the text off up to the next '@'.
std::string_view take_part(std::string_view& text) {
  const std::size_t at = text.find('@');
  const std::string_view part = text.substr(0, at);
  text = at == std::string_view::npos ? std::string_view{} : text.substr(at + 1);
  return part;
}

template <class Number>
bool read(std::string_view text, Number& number) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  return error == std::errc{} && end == text.data() + text.size();
}

}  // namespace

std::string FolderName::url() const {
  return "rtpm://" + wire::host_in_url(host) + ":" + std::to_string(port) + "/" +
         std::string(kNamesPath);
}

std::string to_text(const FolderName& name, std::uint32_t random) {
  return std::string(name.is_registry ? kRegistry : kNames) + "@" + wire::host_in_url(name.host) +
         ":" + std::to_string(name.port) + "@" + std::to_string(name.process_id) + "@" +
         std::to_string(name.network) + "@" + std::to_string(random);
}

std::optional<FolderName> parse_folder_name(std::string_view text) {
  FolderName name;
  const std::string_view kind = take_part(text);
  name.is_registry = kind == kRegistry;
  if (!name.is_registry && kind != kNames) return std::nullopt;
  const auto url = wire::parse_url("rtpm://" + std::string(take_part(text)) + "/x");
  if (!url || url->hosts.size() != 1) return std::nullopt;
  name.host = url->hosts.front();
  name.port = url->port;
  std::uint32_t random = 0;
  const bool is_read = read(take_part(text), name.process_id) &&
                       read(take_part(text), name.network) && read(take_part(text), random);
  return is_read && text.empty() ? std::optional(std::move(name)) : std::nullopt;
}

}  // namespace rtpm::discovery
