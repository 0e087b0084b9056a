#include "rtpm/rt/log.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <string>

#include "rtpm/test/temporary_folder.hpp"

namespace rtpm::rt {
namespace {

std::string written_by(int line_count) {
  const rtpm::test::TemporaryFolder folder;
  std::FILE* const file = std::fopen(folder.file("log").c_str(), "w");
  {
    Log log("test", {.burst = 3, .interval = std::chrono::hours{1}}, file);
    for (int i = 0; i < line_count; ++i)
      log.write("'\x1b[2J' came\ntest: all is well");
    log.tick();
  }
  std::fclose(file);
  return folder.read("log");
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

}  // namespace
}  // namespace rtpm::rt
