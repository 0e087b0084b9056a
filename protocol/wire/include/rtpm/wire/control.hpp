#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/priority.hpp"

/// The payloads of calls to the session itself (service 0). encode() and decode_…() are alloc-free.
/// @source   spec/hprotocol.md#hp-6
namespace rtpm::wire {

/// Looks an object up by its path.
struct BindRequest {
  std::string_view path{};        ///< "lab/arm0"
  std::string_view interface {};  ///< "lab.Arm"
  std::uint64_t fingerprint = 0;  ///< The fingerprint of the client's interface.
};

/// The server's answer. `method_count` MethodEntry follow it.
struct BindReply {
  static constexpr std::size_t kSize = 24;

  std::uint32_t service = 0;            ///< The object's number, valid while the server runs.
  bool is_server_declared = false;      ///< The object's priority applies, not the caller's.
  Priority priority{};                  ///< Declared, or the default for callers without one.
  std::uint64_t fingerprint = 0;        ///< The fingerprint of the server's interface.
  std::uint16_t method_count = 0;       ///< Entries that follow.
  bool is_method_list_complete = true;  ///< False if some entries did not fit the frame.
};

/// One method of the object.
struct MethodEntry {
  static constexpr std::size_t kSize = 8;
  std::uint16_t id = 0;
  std::uint32_t fingerprint = 0;
};

/// @return the encoded size; 0 if a text is too long or `to` is too small
[[nodiscard]] std::size_t encode(const BindRequest& request, MutableBytes to) noexcept;
[[nodiscard]] std::optional<BindRequest> decode_bind_request(ConstBytes payload) noexcept;

void encode(const BindReply& reply, MutableBytes to) noexcept;
void encode(const MethodEntry& entry, MutableBytes to) noexcept;
[[nodiscard]] std::optional<BindReply> decode_bind_reply(ConstBytes payload) noexcept;

/// The request of a describe: the object's number.
/// @source   spec/hprotocol.md#hp-6.3
inline constexpr std::size_t kDescribeRequestSize = 4;
void encode_describe_request(std::uint32_t service, MutableBytes to) noexcept;
[[nodiscard]] std::optional<std::uint32_t> decode_describe_request(ConstBytes payload) noexcept;

/// Entry number `index` of a payload that decode_bind_reply() accepted.
[[nodiscard]] MethodEntry method_entry(ConstBytes bind_reply, std::uint16_t index) noexcept;

}  // namespace rtpm::wire
