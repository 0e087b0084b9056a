#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>

#include "rtpm/base/bytes.hpp"

namespace rtpm::transport {

/// A mapping of shared memory.
/// @ownership unmaps on destruction
/// @threads  any
/// @realtime set-up only
class SharedMapping {
 public:
  enum class Access : std::uint8_t { kRead, kReadWrite };
  /// Maps `size` bytes of the file and makes them resident; empty if the system refuses.
  SharedMapping(int memory, std::size_t size, Access access = Access::kReadWrite) noexcept;
  SharedMapping(SharedMapping&& other) noexcept : bytes_(std::exchange(other.bytes_, {})) {}
  SharedMapping& operator=(SharedMapping&&) = delete;
  ~SharedMapping();
  [[nodiscard]] MutableBytes bytes() const noexcept { return bytes_; }

 private:
  MutableBytes bytes_;
};

}  // namespace rtpm::transport
