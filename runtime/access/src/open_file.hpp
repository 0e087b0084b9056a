#pragma once

#include <unistd.h>

namespace rtpm::access {

/// An open file, closed on destruction.
class File {
 public:
  explicit File(int number) noexcept : number_(number) {}
  File(const File&) = delete;
  File& operator=(const File&) = delete;
  ~File() {
    if (is_open()) ::close(number_);
  }
  [[nodiscard]] int number() const noexcept { return number_; }
  [[nodiscard]] bool is_open() const noexcept { return number_ >= 0; }

 private:
  int number_;
};

}  // namespace rtpm::access
