#include "stored_value.hpp"

#include <nlohmann/json.hpp>

#include "rtpm/base/nesting.hpp"
#include "rtpm/base/whole_number.hpp"
#include "rtpm/file_store/json.hpp"
#include "rtpm/rt/host.hpp"

namespace rtpm::etcd_store {
namespace {

using Json = nlohmann::json;

/// 64-bit numbers are written as text, as in etcd's own JSON: JSON readers may round numbers.
std::optional<std::uint64_t> number_of(const Json& json) {
  if (!json.is_string()) return std::nullopt;
  return whole_number_of<std::uint64_t>(json.get_ref<const std::string&>());
}

std::optional<std::uint64_t> whole_number_at(const Json& json, const char* key) {
  const auto found = json.find(key);
  return found == json.end() ? std::nullopt : number_of(*found);
}

std::optional<std::string> text_at(const Json& json, const char* key) {
  const auto found = json.find(key);
  if (found == json.end() || !found->is_string()) return std::nullopt;
  return found->get<std::string>();
}

/// The host that bound a name, as seen from this registry: a loopback address belongs to the host
/// on which the name's registry ran.
std::uint64_t host_seen_here(std::uint64_t host, std::uint64_t where) {
  const bool is_loopback = host >> 24 == 127;
  return is_loopback && where != rt::clock_domain() ? names::kLoopbackElsewhere : host;
}

}  // namespace

std::string to_text(const StoredValue& value) {
  const names::StoredName& stored = value.stored;
  const Json json{
      {"version", 1},
      {"url", stored.url},
      {"interface", stored.interface},
      {"owner", {std::to_string(stored.owner.id), std::to_string(stored.owner.epoch)}},
      {"holder", std::to_string(stored.revision)},
      {"host", stored.host},
      {"where", std::to_string(value.where)},
      {"lease_ns", std::to_string(stored.lease.count())},
      {"write", std::to_string(value.write)},
      {"properties", parse_bounded_json<Json>(file_store::properties_to_json(stored.properties))}};
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

std::optional<StoredValue> parse_value(std::string_view text) {
  const Json json = parse_bounded_json<Json>(text);
  if (!json.is_object() || json.value("version", Json()) != 1) return std::nullopt;
  auto url = text_at(json, "url");
  auto interface = text_at(json, "interface");
  const auto holder = whole_number_at(json, "holder");
  const auto lease = whole_number_at(json, "lease_ns");
  const auto write = whole_number_at(json, "write");
  const auto where = whole_number_at(json, "where");
  const Json owner = json.value("owner", Json());
  const Json host = json.value("host", Json());
  const bool is_whole = url && interface && holder && lease && write && where && owner.is_array() &&
                        owner.size() == 2 && host.is_number_unsigned();
  if (!is_whole) return std::nullopt;
  const auto id = number_of(owner[0]);
  const auto epoch = number_of(owner[1]);
  auto properties = file_store::properties_from_json(json.value("properties", Json()).dump());
  constexpr auto kLeaseMax = static_cast<std::uint64_t>(Duration::max().count());
  if (!id || !epoch || !properties || *lease > kLeaseMax) return std::nullopt;
  return StoredValue{{.url = std::move(*url),
                      .interface = std::move(*interface),
                      .owner = {*id, *epoch},
                      .revision = *holder,
                      .host = host_seen_here(host.get<std::uint64_t>(), *where),
                      .lease = Duration{static_cast<Duration::rep>(*lease)},
                      .properties = std::move(*properties)},
                     *write,
                     *where};
}

}  // namespace rtpm::etcd_store
