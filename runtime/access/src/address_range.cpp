#include "rtpm/access/address_range.hpp"

#include "os/file.hpp"
#include "rtpm/base/whole_number.hpp"

namespace rtpm::access {
namespace {

constexpr unsigned kBitCount = 128;
constexpr unsigned kMappedBitCount = 96;  // The prefix ::ffff:0:0/96 before an IPv4 address.

bool is_set(const NetworkAddress& address, unsigned bit) noexcept {
  return ((address[bit / 8] >> (7 - bit % 8)) & 1) != 0;
}

}  // namespace

std::optional<NetworkAddress> parse_address(std::string_view text) {
  const std::string copy(text);
  NetworkAddress address{};
  if (os::parse_ipv6(copy, address.data())) return address;
  address = {};
  address[10] = address[11] = 0xff;
  if (os::parse_ipv4(copy, address.data() + 12)) return address;
  return std::nullopt;
}

std::optional<AddressRange> AddressRange::parse(std::string_view text) {
  const std::size_t slash = text.find('/');
  const std::string_view address = text.substr(0, slash);
  const auto prefix = parse_address(address);
  if (!prefix) return std::nullopt;
  const bool is_ipv4 = address.find(':') == std::string_view::npos;
  const unsigned first = is_ipv4 ? kMappedBitCount : 0;
  AddressRange range;
  range.text_ = text;
  range.prefix_ = *prefix;
  range.bit_count_ = kBitCount;
  if (slash == std::string_view::npos) return range;
  const auto bits = whole_number_of<unsigned>(text.substr(slash + 1));
  if (!bits || *bits > kBitCount - first) return std::nullopt;
  range.bit_count_ = first + *bits;
  for (unsigned bit = range.bit_count_; bit < kBitCount; ++bit) {
    if (is_set(range.prefix_, bit)) return std::nullopt;
  }
  return range;
}

bool AddressRange::contains(const NetworkAddress& address) const noexcept {
  if (address == NetworkAddress{}) return false;
  for (unsigned bit = 0; bit < bit_count_; ++bit) {
    if (is_set(prefix_, bit) != is_set(address, bit)) return false;
  }
  return true;
}

}  // namespace rtpm::access
