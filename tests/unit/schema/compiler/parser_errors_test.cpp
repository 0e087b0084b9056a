#include <gtest/gtest.h>

#include <string>

#include "reading/parser_error.hpp"

namespace rtpm::schema {
namespace {

TEST(ParserErrors, PointAtTheTokenThatTheyName) {
  const SourceFile source("arm.fbs", "table Pose {\n  x:double;\n}\n");
  // The parser has read one token more than the wrong one.
  const RawError error{.line = 2, .column_byte = 11, .message = "doubles are no more: \"double\""};
  const Diagnostic shown = diagnostic_of(error, source, flatbuffers::Parser());
  EXPECT_EQ(shown.message, error.message);
  EXPECT_EQ(shown.location.line, 2u);
  EXPECT_EQ(shown.location.column, 5u);
  EXPECT_EQ(shown.location.length, 6u);
}

}  // namespace
}  // namespace rtpm::schema
