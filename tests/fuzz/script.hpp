#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "rtpm/base/bytes.hpp"

namespace rtpm::fuzz {

/// Splits a fuzzer's input: numbers, and frames as a u16 length with that many bytes.
class Script {
 public:
  Script(const std::uint8_t* data, std::size_t size) noexcept
      : reader_(std::as_bytes(std::span(data, size))) {}
  [[nodiscard]] bool has_more() const noexcept { return reader_.left() > 0; }
  [[nodiscard]] std::uint8_t byte() noexcept { return reader_.take<std::uint8_t>(); }
  [[nodiscard]] std::uint32_t number() noexcept { return reader_.take<std::uint32_t>(); }
  [[nodiscard]] ConstBytes bytes() noexcept {
    const std::size_t wanted = reader_.take<std::uint16_t>();
    return reader_.take_bytes(std::min(wanted, reader_.left()));
  }

 private:
  ByteReader reader_;
};

}  // namespace rtpm::fuzz
