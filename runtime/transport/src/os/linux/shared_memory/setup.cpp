#include "shared_memory/setup.hpp"

#include <bit>

namespace rtpm::transport {
namespace {

constexpr std::uint32_t kMagic = 0x4d53'5048;  // "HPSM"
constexpr std::uint16_t kFlagOnlyAsks = 1;

}  // namespace

std::array<std::byte, SetupRequest::kSize> encode(const SetupRequest& request) {
  std::array<std::byte, SetupRequest::kSize> bytes{};
  ByteWriter writer(bytes);
  writer.put(kMagic);
  writer.put(kSetupVersion);
  writer.put(static_cast<std::uint16_t>(request.priority.value()));
  writer.put(request.only_asks ? kFlagOnlyAsks : std::uint16_t{0});
  writer.put_zeros(6);
  return bytes;
}

std::array<std::byte, SetupAnswer::kSize> encode(const SetupAnswer& answer) {
  std::array<std::byte, SetupAnswer::kSize> bytes{};
  ByteWriter writer(bytes);
  writer.put(kMagic);
  writer.put(answer.version);
  writer.put(static_cast<std::uint16_t>(answer.status));
  writer.put(answer.sizes.to_server);
  writer.put(answer.sizes.to_client);
  writer.put_zeros(16);
  return bytes;
}

std::optional<ReadRequest> decode_request(ConstBytes bytes) noexcept {
  ByteReader reader(bytes);
  if (reader.take<std::uint32_t>() != kMagic) return std::nullopt;
  const auto version = reader.take<std::uint16_t>();
  if (!reader.ok()) return std::nullopt;
  // hp-16.1-3: the rest of a request of another version is not checked.
  if (version != kSetupVersion) return ReadRequest{};
  const auto priority = reader.take<std::uint16_t>();
  const auto flags = reader.take<std::uint16_t>();
  // hp-16.1-2
  if (!reader.take_zeros(6) || reader.left() != 0 || priority > Priority::kHighest ||
      (flags & ~kFlagOnlyAsks) != 0) {
    return std::nullopt;
  }
  return ReadRequest{true, {Priority{priority}, (flags & kFlagOnlyAsks) != 0}};
}

std::optional<SetupAnswer> decode_answer(ConstBytes bytes) noexcept {
  ByteReader reader(bytes);
  SetupAnswer answer;
  if (reader.take<std::uint32_t>() != kMagic) return std::nullopt;
  answer.version = reader.take<std::uint16_t>();
  answer.status = static_cast<SetupStatus>(reader.take<std::uint16_t>());
  answer.sizes.to_server = reader.take<std::uint32_t>();
  answer.sizes.to_client = reader.take<std::uint32_t>();
  if (!reader.take_zeros(16) || reader.left() != 0) return std::nullopt;
  return answer;
}

}  // namespace rtpm::transport
