#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/priority.hpp"
#include "rtpm/transport/shared_memory.hpp"

/// The messages on the UNIX socket before the first frame, and the layout of the memory.
/// @source   spec/hprotocol.md#hp-16
namespace rtpm::transport {

inline constexpr std::uint16_t kSetupVersion = 1;

/// The first page holds the control words of both rings; the slots and then the records follow.
inline constexpr std::size_t kToServerSlotsOffset = 4096;
inline constexpr std::size_t kToClientSlotsOffset = kToServerSlotsOffset + kRecordSlotsSize;
inline constexpr std::size_t kRingDataOffset = kToClientSlotsOffset + kRecordSlotsSize;
inline constexpr std::size_t kToServerControlOffset = 0;
inline constexpr std::size_t kToClientControlOffset = 256;
/// The sizes that a server offers, and the limits that a client accepts.
inline constexpr RingSizes kRingSizes{128 * 1024, 128 * 1024};
inline constexpr std::uint32_t kRingSizeMin = 32 * 1024;
inline constexpr std::uint32_t kRingSizeMax = 16 * 1024 * 1024;

[[nodiscard]] constexpr std::size_t memory_size(RingSizes sizes) noexcept {
  return kRingDataOffset + sizes.to_server + sizes.to_client;
}

/// The client's only message.
struct SetupRequest {
  static constexpr std::size_t kSize = 16;
  Priority priority{};
  bool only_asks = false;  ///< Only asks whether it would be accepted.
};

enum class SetupStatus : std::uint16_t {
  kOk = 0,
  kNotAllowed = 1,          ///< The client belongs to another user.
  kVersionUnsupported = 2,  ///< The answer contains the server's own version.
  kNoMemory = 3,            ///< No memory or descriptor is left.
};

/// The server's only message. With kOk, unless the client only asked, the descriptors accompany it.
struct SetupAnswer {
  static constexpr std::size_t kSize = 32;
  SetupStatus status = SetupStatus::kOk;
  std::uint16_t version = kSetupVersion;
  RingSizes sizes{};
};

/// A decoded request; for another version, only that fact.
struct ReadRequest {
  bool is_our_version = false;
  SetupRequest request{};
};

[[nodiscard]] std::array<std::byte, SetupRequest::kSize> encode(const SetupRequest& request);
[[nodiscard]] std::array<std::byte, SetupAnswer::kSize> encode(const SetupAnswer& answer);
/// Decodes a request; nullopt if the bytes are malformed.
[[nodiscard]] std::optional<ReadRequest> decode_request(ConstBytes bytes) noexcept;
[[nodiscard]] std::optional<SetupAnswer> decode_answer(ConstBytes bytes) noexcept;

}  // namespace rtpm::transport
