#pragma once

#include <malloc.h>

#include <cstddef>
#include <fstream>
#include <string>

/// The memory of this process, by the operating system.
namespace rtpm::test {

/// Measures how much more memory this process has at its peak than when this object was made.
/// @threads  one; other threads' memory counts, too
class PeakMemory {
 public:
  PeakMemory() {
    ::malloc_trim(0);  // Freed memory would hide what is allocated later.
    std::ofstream reset("/proc/self/clear_refs");
    reset << "5" << std::flush;
    is_known_ = reset.good();
    begin_ = byte_count("VmRSS:");
  }
  /// Whether this system measures it.
  [[nodiscard]] bool is_known() const noexcept { return is_known_; }
  /// In bytes.
  [[nodiscard]] std::size_t growth() const {
    const std::size_t peak = byte_count("VmHWM:");
    return peak > begin_ ? peak - begin_ : 0;
  }

 private:
  static std::size_t byte_count(const std::string& key) {
    std::ifstream status("/proc/self/status");
    for (std::string line; std::getline(status, line);) {
      if (line.starts_with(key)) return 1024 * std::stoull(line.substr(key.size()));
    }
    return 0;
  }

  bool is_known_ = false;
  std::size_t begin_ = 0;
};

}  // namespace rtpm::test
