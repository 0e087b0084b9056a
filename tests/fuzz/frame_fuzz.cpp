// Any bytes are decoded or dropped, and what is decoded encodes to the same bytes again.

#include <algorithm>
#include <array>
#include <cstdint>

#include "rtpm/base/assert.hpp"
#include "rtpm/wire/control.hpp"
#include "rtpm/wire/fragments.hpp"
#include "rtpm/wire/handshake.hpp"
#include "rtpm/wire/header.hpp"
#include "rtpm/wire/stream.hpp"

using namespace rtpm;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const ConstBytes bytes = std::as_bytes(std::span(data, size));
  if (const auto header = wire::decode(bytes)) {
    std::array<std::byte, wire::kHeaderSize> again{};
    wire::encode(*header, again.data());
    RTPM_ASSERT(std::ranges::equal(again, bytes.first(wire::kHeaderSize)), "headers round-trip");
  }
  if (const auto hello = wire::decode_hello(bytes)) {
    std::array<std::byte, wire::Hello::kSize> again{};
    wire::encode(*hello, again);
    RTPM_ASSERT(std::ranges::equal(again, bytes), "HELLO round-trips");
  }
  if (const auto welcome = wire::decode_welcome(bytes)) {
    std::array<std::byte, wire::Welcome::kSize> again{};
    wire::encode(*welcome, again);
    RTPM_ASSERT(std::ranges::equal(again, bytes), "WELCOME round-trips");
  }
  if (const auto reply = wire::decode_bind_reply(bytes)) {
    for (std::uint16_t i = 0; i < reply->method_count; ++i) {
      static_cast<void>(wire::method_entry(bytes, i));
    }
  }
  if (const auto ack = wire::decode_ack(bytes)) {
    std::array<std::byte, wire::FragmentAck::kSize> again{};
    wire::encode(*ack, again);
    RTPM_ASSERT(std::ranges::equal(again, bytes), "ACK round-trips");
  }
  if (const auto credit = wire::decode_credit(bytes)) {
    std::array<std::byte, wire::StreamCredit::kSize> again{};
    wire::encode(*credit, again);
    RTPM_ASSERT(std::ranges::equal(again, bytes), "CREDIT round-trips");
  }
  static_cast<void>(wire::decode_bind_request(bytes));
  return 0;
}
