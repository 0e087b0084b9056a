#include "rtpm/discovery/datagram.hpp"

#include <algorithm>
#include <span>

namespace rtpm::discovery {
namespace {

// hp-10.1-1: the layout of all datagrams.
constexpr std::uint32_t kMagic = 0x4450'5452;  // "RTPD"
constexpr std::uint8_t kVersion = 1;
constexpr std::uint8_t kQuery = 1;
constexpr std::uint8_t kAnswer = 2;
constexpr std::size_t kServicesOffset = 16;
constexpr std::size_t kServiceSize = 8;
constexpr std::uint8_t kRegistry = 1;
constexpr std::uint8_t kServer = 2;
static_assert(kServicesOffset + kAnsweredServiceCountMax * kServiceSize == kDatagramSize);

template <class Number>
Number get(ConstBytes bytes, std::size_t offset) noexcept {
  return load_le<Number>(bytes.data() + offset);
}

template <class Number>
void put(MutableBytes bytes, std::size_t offset, Number value) noexcept {
  store_le(bytes.data() + offset, value);
}

std::optional<AnsweredService> decode_service(ConstBytes bytes) noexcept {
  const auto kind = get<std::uint8_t>(bytes, 2);
  const AnsweredService service{get<std::uint16_t>(bytes, 0), kind == kRegistry,
                                get<std::uint32_t>(bytes, 4)};
  const bool is_valid = service.port != 0 && (kind == kRegistry || kind == kServer) &&
                        get<std::uint8_t>(bytes, 3) == 0;
  return is_valid ? std::optional(service) : std::nullopt;
}

}  // namespace

DatagramBytes encode(const Datagram& datagram) noexcept {
  DatagramBytes bytes{};
  const std::size_t count = std::min(datagram.services.size(), kAnsweredServiceCountMax);
  put(bytes, 0, kMagic);
  put(bytes, 4, kVersion);
  put(bytes, 5, datagram.is_answer ? kAnswer : kQuery);
  put(bytes, 6, datagram.domain);
  put(bytes, 7, static_cast<std::uint8_t>(count));
  put(bytes, 8, datagram.number);
  for (std::size_t i = 0; i < count; ++i) {
    const AnsweredService& service = datagram.services[i];
    const MutableBytes place = MutableBytes(bytes).subspan(kServicesOffset + i * kServiceSize);
    put(place, 0, service.port);
    put(place, 2, service.is_registry ? kRegistry : kServer);
    put(place, 4, service.process_id);
  }
  return bytes;
}

// hp-10.1-2: malformed datagrams are dropped.
std::optional<Datagram> decode(ConstBytes bytes) {
  if (bytes.size() != kDatagramSize || get<std::uint32_t>(bytes, 0) != kMagic ||
      get<std::uint8_t>(bytes, 4) != kVersion) {
    return std::nullopt;
  }
  const auto kind = get<std::uint8_t>(bytes, 5);
  const std::size_t count = get<std::uint8_t>(bytes, 7);
  const bool has_valid_count =
      kind == kQuery ? count == 0 : kind == kAnswer && count <= kAnsweredServiceCountMax;
  if (!has_valid_count) return std::nullopt;
  Datagram datagram{kind == kAnswer, get<std::uint8_t>(bytes, 6), get<std::uint64_t>(bytes, 8), {}};
  for (std::size_t i = 0; i < count; ++i) {
    const auto service =
        decode_service(bytes.subspan(kServicesOffset + i * kServiceSize, kServiceSize));
    if (!service) return std::nullopt;
    datagram.services.push_back(*service);
  }
  const bool is_clean = std::ranges::all_of(bytes.subspan(kServicesOffset + count * kServiceSize),
                                            [](std::byte byte) { return byte == std::byte{0}; });
  return is_clean ? std::optional(std::move(datagram)) : std::nullopt;
}

}  // namespace rtpm::discovery
