#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace rtpm::access {

/// A network address in IPv6's form; IPv4 as ::ffff:a.b.c.d.
using NetworkAddress = std::array<std::uint8_t, 16>;

/// Parses a numeric IPv4 or IPv6 address without zone; nothing if `text` is not one.
[[nodiscard]] std::optional<NetworkAddress> parse_address(std::string_view text);

/// The addresses that share a prefix: "192.168.7.0/24", "fd00::/8", or one: "192.168.7.4".
class AddressRange {
 public:
  /// Nothing if `text` is not a range, or has bits behind its prefix: a slip in most cases.
  [[nodiscard]] static std::optional<AddressRange> parse(std::string_view text);

  /// @realtime alloc-free
  [[nodiscard]] bool contains(const NetworkAddress& address) const noexcept;

  [[nodiscard]] const std::string& text() const noexcept { return text_; }

  friend bool operator==(const AddressRange&, const AddressRange&) = default;

 private:
  std::string text_;
  NetworkAddress prefix_{};
  unsigned bit_count_ = 0;  // The length of the prefix in IPv6's form.
};

}  // namespace rtpm::access
