#include "rtpm/program/line_reader.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <string>
#include <string_view>

namespace rtpm::program {
namespace {

using Outcome = LineReader::Outcome;

/// Standard input is a pipe that the test writes to.
class Lines : public testing::Test {
 protected:
  Lines() : saved_(dup(STDIN_FILENO)) {
    std::array<int, 2> ends{};
    EXPECT_EQ(pipe(ends.data()), 0);
    dup2(ends[0], STDIN_FILENO);
    close(ends[0]);
    writer_ = ends[1];
  }
  void TearDown() override {
    hang_up();
    dup2(saved_, STDIN_FILENO);
    close(saved_);
  }
  void type(std::string_view text) const {
    EXPECT_EQ(write(writer_, text.data(), text.size()), static_cast<ssize_t>(text.size()));
  }
  void hang_up() {
    if (writer_ >= 0) close(writer_);
    writer_ = -1;
  }
  /// The next line; the test fails if there is none.
  std::string next() {
    std::string line;
    EXPECT_EQ(reader_.read_for(std::chrono::seconds{10}, line), Outcome::kLine);
    return line;
  }
  Outcome look() {
    std::string line;
    return reader_.read_for(Duration{0}, line);
  }

  int saved_;
  int writer_ = -1;
  LineReader reader_{};
};

TEST_F(Lines, AreReadWholeAndInOrder) {
  EXPECT_EQ(look(), Outcome::kNone);
  type("one\n\nth");
  EXPECT_EQ(next(), "one");
  EXPECT_EQ(next(), "");
  EXPECT_EQ(look(), Outcome::kNone) << "half a line";
  type("ree\n");
  EXPECT_EQ(next(), "three");
}

TEST_F(Lines, EndWithTheInput) {
  type("last");
  hang_up();
  EXPECT_EQ(next(), "last") << "without a line feed";
  EXPECT_EQ(look(), Outcome::kEnd);
  EXPECT_EQ(look(), Outcome::kEnd);
}

TEST_F(Lines, AreSplitIfTooLong) {
  type(std::string(3 * LineReader::kLineSizeMax, 'x') + "\n");
  std::size_t size = 0;
  std::string part = next();
  for (; !part.empty(); part = next())
    size += part.size();
  EXPECT_EQ(size, 3 * LineReader::kLineSizeMax);
}

}  // namespace
}  // namespace rtpm::program
