#include "rtpm/access/authorized.hpp"

#include <gtest/gtest.h>

#include "keys.hpp"

namespace rtpm::access {
namespace {

TEST(Authorized, ReadsKeysUsersAndAnonymous) {
  const std::string text = "# The lab\n\n" + text_of(1) +
                           " name=alice role=command on=lab/arm0,lab/cam/** max-priority=24000 "
                           "from=192.168.7.0/24,fd00::/8\r\n"
                           "\tuid:1001 role=observe on=**\n"
                           "anonymous role=observe on=public/*";
  const Authorized read = parse_authorized(text);
  EXPECT_TRUE(read.faults.empty());
  ASSERT_EQ(read.grants.size(), 3U);
  const Grant& alice = read.grants[0];
  EXPECT_EQ(alice.subject, subject_of(1));
  EXPECT_EQ(alice.name, "alice");
  EXPECT_EQ(alice.role, Role::kCommand);
  ASSERT_EQ(alice.objects.size(), 2U);
  EXPECT_EQ(alice.objects[1].text(), "lab/cam/**");
  EXPECT_EQ(alice.ceiling, Priority(24000));
  EXPECT_EQ(alice.from.size(), 2U);
  EXPECT_EQ(read.grants[1].subject, (Subject{Subject::Kind::kLocalUser, 1001, {}}));
  EXPECT_EQ(read.grants[1].ceiling, Priority::kHighest);
  EXPECT_EQ(read.grants[2].subject, Subject{});
}

TEST(Authorized, ReadsTheLinesThatItWrites) {
  const Authorized read = parse_authorized(
      text_of(9) + " name=bob role=configure on=a/*,b max-priority=7 from=10.0.0.0/8,::1\n");
  ASSERT_EQ(read.grants.size(), 1U);
  const Authorized again = parse_authorized(to_line(read.grants[0]));
  ASSERT_EQ(again.grants.size(), 1U) << to_line(read.grants[0]);
  EXPECT_EQ(again.grants[0], read.grants[0]);
}

struct Faulty {
  std::string line;
  std::size_t column;
  std::string why;  ///< A part of the reason.
};
class FaultyLines : public testing::TestWithParam<Faulty> {};

TEST_P(FaultyLines, AreReportedByColumnAndLeaveTheOthersInForce) {
  const Authorized read =
      parse_authorized("uid:1 role=observe on=a\n" + GetParam().line + "\nuid:2 role=observe on=a");
  EXPECT_EQ(read.grants.size(), 2U);
  ASSERT_EQ(read.faults.size(), 1U);
  EXPECT_EQ(read.faults[0].line, 2U);
  EXPECT_EQ(read.faults[0].column, GetParam().column);
  EXPECT_NE(read.faults[0].why.find(GetParam().why), std::string::npos) << read.faults[0].why;
}

INSTANTIATE_TEST_SUITE_P(
    All, FaultyLines,
    testing::Values(
        Faulty{"alice role=observe on=a", 1, "a line begins with"},
        Faulty{"rtpm25519 role=observe on=a", 11, "44 characters"},
        Faulty{"rtpm25519", 1, "44 characters"},
        Faulty{"uid:alice role=observe on=a", 1, "number of a user"},
        Faulty{"uid:-1 role=observe on=a", 1, "number of a user"},
        Faulty{"uid:65534 role=observe on=a", 1, "the kernel can't name"},
        Faulty{"uid:7 role=comand on=a", 12, "observe, command, configure or administer"},
        Faulty{"uid:7 role=none on=a", 12, "observe, command"},
        Faulty{"uid:7 role=observe", 19, "on= is missing"},
        Faulty{"uid:7 on=a", 11, "role= is missing"},
        Faulty{"uid:7 role=observe on=", 23, "pattern of objects"},
        Faulty{"uid:7 role=observe on=a,,b", 25, "pattern of objects"},
        Faulty{"uid:7 role=observe on=a/b*", 23, "pattern of objects"},
        Faulty{"uid:7 role=observe on=/a", 23, "pattern of objects"},
        Faulty{"uid:7 role=observe on=a/", 23, "pattern of objects"},
        Faulty{"uid:7 role=observe on=a on=b", 25, "twice"},
        Faulty{"uid:7 role=observe on=a oops", 25, "NAME=VALUE"},
        Faulty{"uid:7 role=observe on=a deny=b", 25, "unknown setting 'deny'"},
        Faulty{"uid:7 role=observe on=a max-priority=32768", 38, "0 to 32767"},
        Faulty{"uid:7 role=observe on=a from=192.168.7.4/24", 30, "zeros behind"},
        Faulty{"uid:7 role=observe on=a from=10.0.0.0/33", 30, "an address"},
        Faulty{"uid:7 role=observe on=a from=lab", 30, "an address"},
        Faulty{"uid:7 role=ob\x1b[31m on=a", 12, "\\x1b"},
        Faulty{"uid:7 role=observe on=" + std::string(4096, 'a'), 4097, "at most 4096 bytes"}));

TEST(Authorized, PrintsAFaultAsFileLineAndColumn) {
  EXPECT_EQ(to_text({3, 14, "unknown role"}, "authorized"), "authorized:3:14: unknown role");
}

TEST(Authorized, KeepsABoundedNumberOfFaults) {
  std::string text;
  for (int line = 0; line < 10'000; ++line)
    text += "garbage\n";
  const Authorized read = parse_authorized(text);
  EXPECT_EQ(read.faults.size(), kFaultCountMax);
  EXPECT_EQ(read.fault_count, 10'000U);
}

TEST(Authorized, ReportsGrantsBeyondTheLimitAsFaults) {
  std::string text;
  for (std::size_t line = 0; line <= kGrantCountMax; ++line)
    text += "uid:1 role=observe on=a\n";
  const Authorized read = parse_authorized(text);
  EXPECT_EQ(read.grants.size(), kGrantCountMax);
  ASSERT_EQ(read.faults.size(), 1U);
  EXPECT_EQ(read.faults[0].line, kGrantCountMax + 1);
}

}  // namespace
}  // namespace rtpm::access
