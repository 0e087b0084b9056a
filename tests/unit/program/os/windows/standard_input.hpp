#pragma once

#include <fcntl.h>
#include <gtest/gtest.h>
#include <io.h>

#include <array>
#include <string_view>

namespace rtpm::program::test {

/// Makes standard input a pipe that the test writes to.
class StandardInput {
 public:
  StandardInput() : saved_(_dup(0)) {
    std::array<int, 2> ends{};
    EXPECT_EQ(_pipe(ends.data(), 65536, _O_BINARY | _O_NOINHERIT), 0);
    _dup2(ends[0], 0);
    _close(ends[0]);
    writer_ = ends[1];
  }
  StandardInput(const StandardInput&) = delete;
  StandardInput& operator=(const StandardInput&) = delete;
  ~StandardInput() {
    hang_up();
    _dup2(saved_, 0);
    _close(saved_);
  }
  void type(std::string_view text) const {
    EXPECT_EQ(_write(writer_, text.data(), static_cast<unsigned>(text.size())),
              static_cast<int>(text.size()));
  }
  void hang_up() {
    if (writer_ >= 0) _close(writer_);
    writer_ = -1;
  }

 private:
  int saved_;
  int writer_ = -1;
};

}  // namespace rtpm::program::test
