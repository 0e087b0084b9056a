#include "rtpm/rt/log.hpp"

#include <gtest/gtest.h>

#include <string>

#include "rtpm/test/child.hpp"

namespace rtpm::rt {
namespace {

TEST(Log, PrintsErrorsInOneLine) {
  const auto child = rtpm::test::run_in_child([] {
    print_error("rtpm-test", "the hub says: \x1b]0;x\x07\nrtpm-test: all is well");
    return std::string();
  });
  EXPECT_EQ(child.errors, "rtpm-test: the hub says: \\x1b]0;x\\x07\\nrtpm-test: all is well\n");
}

}  // namespace
}  // namespace rtpm::rt
