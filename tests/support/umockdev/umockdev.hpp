#pragma once

#include <umockdev.h>

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

/// umockdev replaces the kernel by a library that is loaded before the system's. The main() that
/// comes with this header starts the program again with that library.
namespace rtpm::test {

/// Why umockdev does not replace the kernel here; empty if it does.
[[nodiscard]] std::string umockdev_obstacle();

/// Memory of the program that called an ioctl.
/// @ownership has its reference
class IoctlMemory {
 public:
  IoctlMemory(UMockdevIoctlClient* client, std::size_t size);
  IoctlMemory(const IoctlMemory&) = delete;
  IoctlMemory& operator=(const IoctlMemory&) = delete;
  ~IoctlMemory();
  /// Null if the program gave no memory.
  [[nodiscard]] const std::uint8_t* data() const noexcept;
  void put(std::vector<std::uint8_t> bytes) const;

 private:
  UMockdevIoctlData* data_;
};

}  // namespace rtpm::test
