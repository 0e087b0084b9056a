#include "folder_name.hpp"

#include "rtpm/base/whole_number.hpp"
#include "rtpm/discovery/scope.hpp"
#include "rtpm/wire/url.hpp"

namespace rtpm::discovery {
namespace {

constexpr std::string_view kRegistryKind = "registry";
constexpr std::string_view kNamesKind = "names";

/// Removes and returns the text up to the next '@'.
std::string_view take_part(std::string_view& text) {
  const std::size_t at = text.find('@');
  const std::string_view part = text.substr(0, at);
  text = at == std::string_view::npos ? std::string_view{} : text.substr(at + 1);
  return part;
}

}  // namespace

std::string FolderName::url() const {
  return "rtpm://" + wire::host_in_url(host) + ":" + std::to_string(port) + "/" +
         std::string(kNamesPath);
}

std::string to_text(const FolderName& name, std::uint32_t random) {
  return std::string(name.is_registry ? kRegistryKind : kNamesKind) + "@" +
         wire::host_in_url(name.host) + ":" + std::to_string(name.port) + "@" +
         std::to_string(name.process_id) + "@" + std::to_string(name.network) + "@" +
         std::to_string(random);
}

std::optional<FolderName> parse_folder_name(std::string_view text) {
  FolderName name;
  const std::string_view kind = take_part(text);
  name.is_registry = kind == kRegistryKind;
  if (!name.is_registry && kind != kNamesKind) return std::nullopt;
  const auto url = wire::parse_url("rtpm://" + std::string(take_part(text)) + "/x");
  if (!url || url->hosts.size() != 1) return std::nullopt;
  name.host = url->hosts.front();
  name.port = url->port;
  const auto process_id = whole_number_of<decltype(name.process_id)>(take_part(text));
  const auto network = whole_number_of<decltype(name.network)>(take_part(text));
  const auto random = whole_number_of<std::uint32_t>(take_part(text));
  if (!process_id || !network || !random || !text.empty()) return std::nullopt;
  name.process_id = *process_id;
  name.network = *network;
  return name;
}

}  // namespace rtpm::discovery
