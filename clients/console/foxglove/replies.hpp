#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/bytes.hpp"

/// The frames of the Foxglove WebSocket protocol that this server sends.
namespace rtpm::console::foxglove {

/// The supported sub-protocols, the preferred one first; they are identical on the wire.
inline constexpr std::array<std::string_view, 2> kSubprotocols{"foxglove.sdk.v1",
                                                               "foxglove.websocket.v1"};

/// Writes `json` in one line; invalid UTF-8, which foreign text may have, is replaced.
[[nodiscard]] std::string dumped(const nlohmann::ordered_json& json);

enum class StatusLevel : std::uint8_t { kInfo = 0, kWarning = 1, kError = 2 };

struct ServerInfo {
  std::string name{};
  std::vector<std::string> capabilities{};
  std::vector<std::string> encodings{};
  std::map<std::string, std::string> metadata{};
  std::string session_id{};
};

/// A channel as it is advertised.
struct ChannelInfo {
  std::uint32_t id = 0;
  std::string topic{};
  std::string encoding{};
  std::string schema_name{};
  std::string schema{};  ///< Base64 if the schema is binary.
  std::string schema_encoding{};
};

/// The schema of a request or reply.
struct PayloadInfo {
  std::string encoding{};
  std::string schema_name{};
  std::string schema_encoding{};
  std::string schema{};
};
struct ServiceInfo {
  std::uint32_t id = 0;
  std::string name{};
  std::string type{};
  PayloadInfo request{};
  PayloadInfo response{};
};

/// A parameter with its current value.
struct ParameterInfo {
  std::string name{};
  nlohmann::json value{};
  /// Such as "float64", "float64_array"; if empty, the type of the JSON value.
  std::string type{};
};

/// The ids of publishers, subscribers and service providers, by topic or service.
struct Graph {
  using Ids = std::map<std::string, std::set<std::string>>;
  Ids published_topics{};
  Ids subscribed_topics{};
  Ids services{};
  friend bool operator==(const Graph&, const Graph&) = default;
};

[[nodiscard]] std::string server_info(const ServerInfo& info);
[[nodiscard]] std::string status(StatusLevel level, std::string_view message);
[[nodiscard]] std::string advertise(std::span<const ChannelInfo> channels);
[[nodiscard]] std::string unadvertise(std::span<const std::uint32_t> ids);
[[nodiscard]] std::string advertise_services(std::span<const ServiceInfo> services);
[[nodiscard]] std::string unadvertise_services(std::span<const std::uint32_t> ids);
[[nodiscard]] std::string parameter_values(std::span<const ParameterInfo> parameters,
                                           const std::optional<std::string>& id);
/// The change from `before` to `after`.
[[nodiscard]] std::string graph_update(const Graph& before, const Graph& after);
[[nodiscard]] std::string service_call_failure(std::uint32_t service_id, std::uint32_t call_id,
                                               std::string_view message);

/// The size of the header of a message frame; the payload follows it.
inline constexpr std::size_t kMessageHeadSize = 13;
[[nodiscard]] std::array<std::byte, kMessageHeadSize> message_head(std::uint32_t subscription_id,
                                                                   std::uint64_t log_time_ns);
/// A complete binary frame.
[[nodiscard]] std::string service_call_response(std::uint32_t service_id, std::uint32_t call_id,
                                                std::string_view encoding, ConstBytes payload);

}  // namespace rtpm::console::foxglove
