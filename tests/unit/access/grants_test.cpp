#include "rtpm/access/grants.hpp"

#include <gtest/gtest.h>

#include <utility>
#include <vector>

#include "keys.hpp"

namespace rtpm::access {
namespace {

Grants grants_of(const std::string& text) {
  Authorized read = parse_authorized(text);
  EXPECT_TRUE(read.faults.empty());
  return Grants(std::move(read.grants));
}

Subject user(std::uint32_t number) {
  return {Subject::Kind::kLocalUser, number, {}};
}

TEST(ObjectPattern, CoversPathsByComponents) {
  struct Case {
    const char* pattern;
    std::vector<const char*> covered;
    std::vector<const char*> others;
  };
  for (const Case& each : std::vector<Case>{
           {"lab/arm0", {"lab/arm0"}, {"lab", "lab/arm", "lab/arm00", "lab/arm0/x", "x/lab/arm0"}},
           {"lab/*", {"lab/arm0", "lab/x"}, {"lab", "lab/a/b", "labs/a"}},
           {"*/arm0", {"lab/arm0"}, {"arm0", "a/b/arm0"}},
           {"lab/**", {"lab", "lab/arm0", "lab/a/b/c"}, {"la", "labs", "x/lab"}},
           {"**", {"a", "a/b/c"}, {}},
           {"**/cam", {"cam", "a/cam", "a/b/cam"}, {"cam/a", "a/cams"}},
           {"a/**/z", {"a/z", "a/b/z", "a/b/c/z", "a/z/z"}, {"a", "z", "a/z/b"}},
           {"a/**/b/**/c", {"a/b/c", "a/x/b/y/c", "a/b/x/b/c"}, {"a/c", "a/b", "a/b/c/d"}},
           {"**/*", {"a", "a/b"}, {}},
           {"**/a/*", {"a/b", "a/a/b", "x/a/a"}, {"a", "b/a"}}}) {
    const auto pattern = ObjectPattern::parse(each.pattern);
    ASSERT_TRUE(pattern) << each.pattern;
    for (const char* path : each.covered)
      EXPECT_TRUE(pattern->covers(path)) << each.pattern << " covers " << path;
    for (const char* path : each.others)
      EXPECT_FALSE(pattern->covers(path)) << each.pattern << " does not cover " << path;
  }
}

TEST(AddressRange, ContainsAddressesWithItsPrefix) {
  const auto contains = [](const char* range, const char* address) {
    return AddressRange::parse(range)->contains(*parse_address(address));
  };
  EXPECT_TRUE(contains("192.168.7.0/24", "192.168.7.255"));
  EXPECT_FALSE(contains("192.168.7.0/24", "192.168.8.0"));
  EXPECT_TRUE(contains("10.0.0.0/7", "11.1.2.3"));
  EXPECT_TRUE(contains("0.0.0.0/0", "1.2.3.4"));
  EXPECT_FALSE(contains("0.0.0.0/0", "fd00::1"));
  EXPECT_TRUE(contains("::/0", "1.2.3.4"));
  EXPECT_TRUE(contains("fd00::/8", "fdff::1"));
  EXPECT_FALSE(contains("fd00::/8", "fe80::1"));
  EXPECT_TRUE(contains("10.1.2.3", "10.1.2.3"));
  EXPECT_FALSE(contains("10.1.2.3", "10.1.2.4"));
  // An IPv4 address as a dual-stack socket shows it.
  EXPECT_TRUE(contains("192.168.7.0/24", "::ffff:192.168.7.4"));
}

TEST(Grants, RefuseUnknownSubjects) {
  const Grants grants = grants_of("uid:1 role=administer on=**");
  EXPECT_TRUE(grants.knows(user(1), std::nullopt));
  EXPECT_FALSE(grants.knows(user(2), std::nullopt));
  EXPECT_FALSE(grants.knows({}, std::nullopt));
  EXPECT_FALSE(grants.knows(subject_of(1), std::nullopt));
  EXPECT_EQ(grants.permission(user(2), std::nullopt, "lab/arm0").role, Role::kNone);
  EXPECT_EQ(Grants().permission(user(1), std::nullopt, "lab/arm0").role, Role::kNone);
}

TEST(Grants, AddUpForOneSubject) {
  const Grants grants = grants_of(text_of(1) + " name=alice role=observe on=** max-priority=100\n" +
                                  "uid:1 role=administer on=**\n" + text_of(1) +
                                  " role=command on=lab/* max-priority=24000\n");
  const auto arm = grants.permission(subject_of(1), std::nullopt, "lab/arm0");
  EXPECT_EQ(arm.role, Role::kCommand);
  EXPECT_EQ(arm.ceiling, Priority(24000));
  const auto registry = grants.permission(subject_of(1), std::nullopt, "rtpm/names");
  EXPECT_EQ(registry.role, Role::kObserve);
  EXPECT_EQ(registry.ceiling, Priority(100));
  EXPECT_EQ(grants.ceiling(subject_of(1), std::nullopt), Priority(24000));
  EXPECT_EQ(grants.name_of(subject_of(1)), "alice");
  EXPECT_EQ(grants.name_of(subject_of(2)), "");
}

TEST(Grants, ApplyOnlyFromTheirAddresses) {
  const Grants grants = grants_of(text_of(1) + " role=command on=** from=192.168.7.0/24,10.0.0.1");
  const auto role_from = [&](const char* address) {
    return grants.permission(subject_of(1), parse_address(address), "lab/arm0").role;
  };
  EXPECT_EQ(role_from("192.168.7.9"), Role::kCommand);
  EXPECT_EQ(role_from("10.0.0.1"), Role::kCommand);
  EXPECT_EQ(role_from("10.0.0.2"), Role::kNone);
  EXPECT_FALSE(grants.knows(subject_of(1), parse_address("10.0.0.2")));
}

TEST(Grants, ReportSubjectsWithFewerRightsThanBefore) {
  const std::string before = "uid:1 role=command on=a,b max-priority=100 from=10.0.0.0/8\n";
  struct Case {
    const char* after;
    bool is_narrowed;
  };
  for (const Case& each : std::vector<Case>{
           {"uid:1 role=command on=a,b max-priority=100 from=10.0.0.0/8\n", false},
           {"uid:1 name=new role=command on=b,a max-priority=100 from=10.0.0.0/8\n", false},
           {"uid:1 role=configure on=** max-priority=200\n", false},
           {"uid:2 role=observe on=x\nuid:1 role=command on=a,b,c\n", false},
           {"", true},
           {"uid:2 role=command on=a,b\n", true},
           {"uid:1 role=observe on=a,b max-priority=100 from=10.0.0.0/8\n", true},
           {"uid:1 role=command on=a max-priority=100 from=10.0.0.0/8\n", true},
           {"uid:1 role=command on=a,b max-priority=99 from=10.0.0.0/8\n", true},
           {"uid:1 role=command on=a,b max-priority=100 from=10.1.0.0/16\n", true}}) {
    const auto narrowed = grants_of(before).narrowed_by(grants_of(each.after));
    EXPECT_EQ(narrowed, each.is_narrowed ? std::vector{user(1)} : std::vector<Subject>{})
        << each.after;
  }
  EXPECT_EQ(grants_of("uid:1 role=command on=a\n")
                .narrowed_by(grants_of("uid:1 role=command on=a from=10.0.0.0/8\n")),
            std::vector{user(1)});
}

TEST(Grants, NameTheLineThatAllowsARefusedCall) {
  const std::string line = missing_line(subject_of(3), Role::kCommand, "lab/arm0");
  const Grants grants = grants_of(line);
  EXPECT_EQ(grants.permission(subject_of(3), std::nullopt, "lab/arm0").role, Role::kCommand);
  EXPECT_EQ(missing_line(user(7), Role::kObserve, "a"), "uid:7 role=observe on=a");
}

}  // namespace
}  // namespace rtpm::access
