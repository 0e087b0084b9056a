#include "umockdev.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <iterator>

namespace rtpm::test {

std::string umockdev_obstacle() {
  // umockdev_in_mock_environment() returns false on some machines where umockdev works.
  std::ifstream maps("/proc/self/maps");
  const std::string text{std::istreambuf_iterator<char>(maps), {}};
  if (text.find("libumockdev-preload") != std::string::npos) return {};
  return "umockdev's library can't be preloaded: install the package umockdev; under a sanitizer, "
         "whose own library must come first, it never can";
}

IoctlMemory::IoctlMemory(UMockdevIoctlClient* client, std::size_t size)
    : data_(umockdev_ioctl_data_resolve(umockdev_ioctl_client_get_arg(client), 0, size, nullptr)) {}

IoctlMemory::~IoctlMemory() {
  if (data_ != nullptr) umockdev_ioctl_data_unref(data_);
}

const std::uint8_t* IoctlMemory::data() const noexcept {
  return data_ == nullptr ? nullptr : data_->data;
}

void IoctlMemory::put(std::vector<std::uint8_t> bytes) const {
  umockdev_ioctl_data_update(data_, 0, bytes.data(), static_cast<gint>(bytes.size()));
}

}  // namespace rtpm::test

/// Starts this program again with umockdev's library in front of the system's, like
/// umockdev-wrapper.
int main(int argc, char** argv) {
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
  if (!rtpm::test::umockdev_obstacle().empty() && std::getenv("RTPM_TEST_PRELOADED") == nullptr) {
    setenv("RTPM_TEST_PRELOADED", "1", 1);
    setenv("LD_PRELOAD", "libumockdev-preload.so.0", 1);
    execv("/proc/self/exe", argv);
  }
#endif
  testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
