#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace rtpm::access {

/// A network address in IPv6 form; IPv4 as ::ffff:a.b.c.d. An unknown one is ::.
using NetworkAddress = std::array<std::uint8_t, 16>;

/// Parses a numeric IPv4 or IPv6 address without a zone; nullopt if `text` is not one.
[[nodiscard]] std::optional<NetworkAddress> parse_address(std::string_view text);

/// The addresses that share a prefix: "192.168.7.0/24", "fd00::/8"; or a single one: "192.168.7.4".
class AddressRange {
 public:
  /// Parses a range; nullopt if `text` is not one, or has bits set after its prefix, which is
  /// usually a mistake.
  [[nodiscard]] static std::optional<AddressRange> parse(std::string_view text);

  /// False for an unknown address.
  /// @realtime alloc-free
  [[nodiscard]] bool contains(const NetworkAddress& address) const noexcept;

  [[nodiscard]] const std::string& text() const noexcept { return text_; }

  friend bool operator==(const AddressRange&, const AddressRange&) = default;

 private:
  std::string text_;
  NetworkAddress prefix_{};
  unsigned bit_count_ = 0;  // The prefix length in IPv6 form.
};

}  // namespace rtpm::access
