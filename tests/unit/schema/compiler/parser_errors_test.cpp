#include <gtest/gtest.h>

#include <string>

#include "reading/parser.hpp"

// Messages of FlatBuffers' parser that rtpmc does not know, as of a newer release.
namespace rtpm::schema {
namespace {

class NoTypes final : public ParsedSoFar {
 public:
  [[nodiscard]] std::string kind_of(const std::string&) const override { return {}; }
  [[nodiscard]] std::string similar_type(const std::string&) const override { return {}; }
};

TEST(ParserErrors, UnknownMessagesAreShownAsTheyAre) {
  const SourceFile source("arm.fbs", "table Pose {\n  x:double;\n}\n");
  // The parser has read one token more than the wrong one.
  const RawError error{.line = 2, .column_byte = 11, .message = "doubles are no more: \"double\""};
  const Diagnostic shown = translate(error, source, NoTypes());
  EXPECT_EQ(shown.message, error.message);
  EXPECT_EQ(shown.location.line, 2u);
  EXPECT_EQ(shown.location.column, 5u);
  EXPECT_EQ(shown.location.length, 6u);
}

}  // namespace
}  // namespace rtpm::schema
