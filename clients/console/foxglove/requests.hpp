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

/// The most entries read from one list.
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
  std::vector<std::string> names{};  ///< If empty, all.
  std::optional<std::string> id{};
};
/// A parameter as a client sets it.
struct ParameterRequest {
  std::string name{};
  nlohmann::json value{};  ///< null if absent, which means to unset it, or if not read.
  std::string type{};      ///< "float64", "float64_array", "byte_array"; empty if not stated.
};
struct SetParameters {
  std::vector<ParameterRequest> parameters{};
  std::optional<std::string> id{};
};
struct WatchParameters {
  std::vector<std::string> names{};  ///< If empty, all.
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
/// @param may_command  if false, the values that parameters are set to are not read
/// @errors   described in words: not JSON, nested deeper than kNestingMax, an unknown operation, a
///           field that is missing or has the wrong type
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
/// @errors   described in words: truncated, or an opcode other than a service call's
[[nodiscard]] expected<ServiceCall, std::string> read_binary(ConstBytes frame);

}  // namespace rtpm::console::foxglove
