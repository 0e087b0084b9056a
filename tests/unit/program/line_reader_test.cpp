#include "rtpm/program/line_reader.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <string>
#include <string_view>
#include <thread>

#include "standard_input.hpp"

namespace rtpm::program {
namespace {

using Outcome = LineReader::Outcome;

class Lines : public testing::Test {
 protected:
  void type(std::string_view text) { input_.type(text); }
  void hang_up() { input_.hang_up(); }
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

  test::StandardInput input_{};
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

TEST_F(Lines, AreAwaited) {
  std::thread writer([&] { type("late\n"); });
  EXPECT_EQ(next(), "late");
  writer.join();
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
