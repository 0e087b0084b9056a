#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/expected.hpp"

/// The frames that a client of the Foxglove WebSocket protocol sends, read from untrusted bytes.
/// @source   the protocol's specification, version 1
namespace rtpm::console::foxglove {

/// The number of entries that are read from one list at most.
inline constexpr std::size_t kListSizeMax = 4096;

struct Subscription {
  std::uint32_t id = 0;
  std::uint32_t channel_id = 0;
  friend bool operator==(const Subscription&, const Subscription&) = default;
};

struct Subscribe {
  std::vector<Subscription> subscriptions{};
};
struct Unsubscribe {
  std::vector<std::uint32_t> subscription_ids{};
};
struct GetParameters {
  std::vector<std::string> names{};  ///< All if empty.
  std::optional<std::string> id{};
};
/// A parameter as clients set it.
struct ParameterRequest {
  std::string name{};
  nlohmann::json value{};  ///< null: absent, which asks to unset it, or not read.
  std::string type{};      ///< "float64", "float64_array", "byte_array"; empty if not stated.
};
struct SetParameters {
  std::vector<ParameterRequest> parameters{};
  std::optional<std::string> id{};
};
struct WatchParameters {
  std::vector<std::string> names{};  ///< All if empty.
  bool is_watching = true;
};
struct WatchGraph {
  bool is_watching = true;
};
/// An operation of a capability that this server lacks.
struct Unsupported {
  std::string op{};
};

using TextRequest = std::variant<Subscribe, Unsubscribe, GetParameters, SetParameters,
                                 WatchParameters, WatchGraph, Unsupported>;

/// Reads a text frame.
/// @param may_command  false: the values that parameters are set to are not read
/// @errors   in words: no JSON, nested deeper than kNestingMax, no known operation, a field that is
///           missing or of a wrong type
[[nodiscard]] expected<TextRequest, std::string> read_text(std::string_view text, bool may_command);

/// A call of a service.
/// @ownership views the frame
struct ServiceCall {
  std::uint32_t service_id = 0;
  std::uint32_t call_id = 0;
  std::string_view encoding{};
  ConstBytes payload{};
};

/// Reads a binary frame.
/// @errors   in words: cut off, or an opcode other than that of a service call
[[nodiscard]] expected<ServiceCall, std::string> read_binary(ConstBytes frame);

}  // namespace rtpm::console::foxglove
