#include "rtpm/rt/log.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "rtpm/test/child.hpp"

namespace rtpm::rt {
namespace {

std::string written_by(int line_count) {
  char* text = nullptr;
  std::size_t size = 0;
  std::FILE* const file = open_memstream(&text, &size);
  {
    Log log("test", {.burst = 3, .interval = std::chrono::hours{1}}, file);
    for (int i = 0; i < line_count; ++i)
      log.write("'\x1b[2J' came\ntest: all is well");
    log.tick();
  }
  std::fclose(file);
  std::string all(text, size);
  std::free(text);
  return all;
}

TEST(Log, EscapesItsLines) {
  EXPECT_EQ(written_by(1), "test: '\\x1b[2J' came\\ntest: all is well\n");
}

TEST(Log, ReportsHowManyLinesItSuppressed) {
  const std::string text = written_by(102);
  EXPECT_NE(text.find("test: … and "), std::string::npos) << text;
  EXPECT_LE(std::count(text.begin(), text.end(), '\n'), 5) << text;
  std::uint64_t suppressed = 0;
  for (std::size_t at = text.find("and "); at != std::string::npos; at = text.find("and ", at + 1))
    suppressed += std::stoull(text.substr(at + 4));
  EXPECT_EQ(suppressed, 100U) << text;
}

TEST(Log, PrintsErrorsInOneLine) {
  const auto child = rtpm::test::run_in_child([] {
    print_error("rtpm-test", "the hub says: \x1b]0;x\x07\nrtpm-test: all is well");
    return std::string();
  });
  EXPECT_EQ(child.errors, "rtpm-test: the hub says: \\x1b]0;x\\x07\\nrtpm-test: all is well\n");
}

}  // namespace
}  // namespace rtpm::rt
