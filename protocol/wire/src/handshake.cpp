#include "rtpm/wire/handshake.hpp"

#include <algorithm>
#include <bit>

#include "rtpm/base/assert.hpp"

namespace rtpm::wire {
namespace {

[[nodiscard]] std::optional<Priority> take_priority(ByteReader& reader) noexcept {
  const auto value = reader.take<std::uint16_t>();
  if (!Priority::is_valid(value)) return std::nullopt;
  return Priority{value};
}

}  // namespace

void encode(const Hello& hello, MutableBytes to) noexcept {
  ByteWriter writer(to);
  writer.put(hello.version_min);
  writer.put(hello.version_max);
  writer.put(hello.features);
  writer.put(hello.client_epoch);
  writer.put(hello.channel);
  writer.put(hello.clock_domain);
  writer.put(hello.message_size_max);
  writer.put(std::uint32_t{0});
  writer.put_bytes(hello.cookie);
  writer.put_zeros(8);
  RTPM_ASSERT(writer.ok() && writer.size() == Hello::kSize, "HELLO has its size");
}

// hp-4.1-1: a later version may give the reserved bytes a meaning, which this one must not ignore.
std::optional<Hello> decode_hello(ConstBytes payload) noexcept {
  if (payload.size() != Hello::kSize) return std::nullopt;
  ByteReader reader(payload);
  Hello hello;
  hello.version_min = reader.take<std::uint16_t>();
  hello.version_max = reader.take<std::uint16_t>();
  hello.features = reader.take<std::uint32_t>();
  hello.client_epoch = reader.take<std::uint64_t>();
  hello.channel = reader.take<std::uint64_t>();
  hello.clock_domain = reader.take<std::uint64_t>();
  hello.message_size_max = reader.take<std::uint32_t>();
  const bool is_first_zero = reader.take_zeros(4);
  std::ranges::copy(reader.take_bytes(hello.cookie.size()), hello.cookie.begin());
  const bool is_second_zero = reader.take_zeros(8);
  if (!is_first_zero || !is_second_zero || hello.client_epoch == 0) return std::nullopt;
  return hello;
}

void encode(const Welcome& welcome, MutableBytes to) noexcept {
  ByteWriter writer(to);
  writer.put(welcome.version);
  writer.put(welcome.band.low.value());
  writer.put(welcome.band.high.value());
  writer.put(welcome.ceiling.value());
  writer.put(welcome.features);
  writer.put(welcome.window);
  writer.put(std::uint16_t{0});
  writer.put(welcome.server_epoch);
  writer.put(welcome.clock_domain);
  writer.put(welcome.message_size_max);
  writer.put_zeros(12);
  RTPM_ASSERT(writer.ok() && writer.size() == Welcome::kSize, "WELCOME has its size");
}

// hp-4.3-1, except the checks against the client's priority and the header's session.
std::optional<Welcome> decode_welcome(ConstBytes payload, std::uint32_t features) noexcept {
  if (payload.size() != Welcome::kSize) return std::nullopt;
  ByteReader reader(payload);
  Welcome welcome;
  welcome.version = reader.take<std::uint16_t>();
  const auto low = take_priority(reader);
  const auto high = take_priority(reader);
  const auto ceiling = take_priority(reader);
  welcome.features = reader.take<std::uint32_t>();
  welcome.window = reader.take<std::uint16_t>();
  const bool is_first_zero = reader.take_zeros(2);
  welcome.server_epoch = reader.take<std::uint64_t>();
  welcome.clock_domain = reader.take<std::uint64_t>();
  welcome.message_size_max = reader.take<std::uint32_t>();
  const bool is_second_zero = reader.take_zeros(12);
  if (!low || !high || !ceiling || *low > *high || !is_first_zero || !is_second_zero ||
      welcome.version != kVersion || !std::has_single_bit(welcome.window) ||
      welcome.server_epoch == 0 || (welcome.features & ~features) != 0 ||
      welcome.message_size_max < kMessageSizeFloor ||
      welcome.message_size_max > kMessageSizeCeiling) {
    return std::nullopt;
  }
  welcome.band = {*low, *high};
  welcome.ceiling = *ceiling;
  return welcome;
}

}  // namespace rtpm::wire
