#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <string_view>

namespace rtpm::program::test {

/// Makes standard input a pipe that the test writes to.
class StandardInput {
 public:
  StandardInput() : saved_(::dup(0)) {
    std::array<int, 2> ends{};
    EXPECT_EQ(::pipe(ends.data()), 0);
    ::dup2(ends[0], 0);
    ::close(ends[0]);
    writer_ = ends[1];
  }
  StandardInput(const StandardInput&) = delete;
  StandardInput& operator=(const StandardInput&) = delete;
  ~StandardInput() {
    hang_up();
    ::dup2(saved_, 0);
    ::close(saved_);
  }
  void type(std::string_view text) const {
    EXPECT_EQ(::write(writer_, text.data(), text.size()), static_cast<ssize_t>(text.size()));
  }
  void hang_up() {
    if (writer_ >= 0) ::close(writer_);
    writer_ = -1;
  }

 private:
  int saved_;
  int writer_ = -1;
};

}  // namespace rtpm::program::test
