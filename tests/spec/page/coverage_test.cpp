#include "coverage.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "expect_fault.hpp"

// Each MUST of spec/hprotocol.md and spec/events.md has code and a test, and this check itself
// finds planted faults.
namespace rtpm::spec {
namespace {

using tidy::expect_fault;

constexpr const char* kPlantedPage =
    "# A page\n"
    "The words MUST and MAY have their meaning.\n"
    "## 1 One {#hp-1}\n"
    "- `[hp-1-1]` A side MUST do this.\n"
    "- `[hp-1-2]` A side may do that, on two lines,\n"
    "  of which the second has the MUST NOT.\n"
    "- `[hp-1-3]` A side SHOULD do this.\n"
    "\n"
    "## 2 Two {#hp-2}\n"
    "### 2.1 More {#hp-2.1}\n"
    "- `[hp-2.1-1]` A side MUST do more.\n";

/// A small tree without faults, plus `extra`.
std::vector<SourceFile> planted(const std::vector<SourceFile>& extra = {}) {
  std::vector<SourceFile> files{
      {"spec/hprotocol.md", kPlantedPage},
      {"protocol/wire/src/a.cpp", "// hp-1-1: why. See hp-2.1.\nint a;  // hp-1-2, hp-2.1-1\n"},
      {"tests/unit/wire/a_test.cpp", "// hp-1-1 and hp-1-2\n// spec/hprotocol.md#hp-2\n"},
      {"spec/vectors/a.json", "{\"rules\": [\"hp-2.1-1\"]}\n"},
  };
  for (const SourceFile& file : extra) {
    const auto same = std::ranges::find(files, file.path, &SourceFile::path);
    if (same == files.end()) {
      files.push_back(file);
    } else {
      *same = file;
    }
  }
  return files;
}

TEST(RuleCoverage, IsComplete) {
  const auto files = tidy::read_tree(RTPM_SOURCE_FOLDER);
  const auto page = std::ranges::find(files, "spec/hprotocol.md", &SourceFile::path);
  ASSERT_NE(page, files.end());
  EXPECT_GT(std::ranges::count_if(rules_of(page->text), &Rule::is_must), 20) << "the page is read";
  tidy::expect_no_fault(find_uncovered(files));
}

TEST(RuleCoverage, CoversThePageOfEvents) {
  const SourceFile page{"spec/events.md", "## 1 One {#ev-1}\n- `[ev-1-1]` A hub MUST do this.\n"};
  expect_fault(find_uncovered(planted({page})), "spec/events.md:2", "ev-1-1");
  const SourceFile code{"registry/events/src/a.cpp", "// ev-1-1: why\n"};
  const SourceFile test{"tests/unit/events/a_test.cpp", "// ev-1-1\n"};
  EXPECT_TRUE(find_uncovered(planted({page, code, test})).empty());
  EXPECT_FALSE(find_uncovered(planted({code})).empty()) << "cites a rule that is not there";
}

TEST(RuleCoverage, ReadsRulesWithTheirStrength) {
  const std::vector<Rule> rules = rules_of(kPlantedPage);
  ASSERT_EQ(rules.size(), 4u);
  EXPECT_EQ(rules[0].anchor, "hp-1-1");
  EXPECT_TRUE(rules[0].is_must);
  EXPECT_TRUE(rules[1].is_must) << "the MUST NOT on its second line";
  EXPECT_FALSE(rules[2].is_must);
  EXPECT_EQ(rules[3].anchor, "hp-2.1-1");
  EXPECT_TRUE(find_uncovered(planted()).empty());
}

TEST(RuleCoverage, FindsARuleWithoutCodeOrTest) {
  const auto faults = find_uncovered(planted({
      {"protocol/wire/src/a.cpp", "// hp-1-2, hp-2.1-1\nconst char* a = \"hp-1-1\";\n"},
      {"tests/unit/wire/a_test.cpp", "// hp-1-1\n"},
      {"gvd/service/src/a.cpp", "// hp-1-1\n"},
      {"tests/spec/page/coverage_test.cpp", "// hp-1-2\n"},
  }));
  EXPECT_EQ(faults.size(), 2u);
  expect_fault(faults, "spec/hprotocol.md:4:", "hp-1-1 is cited in no code");
  expect_fault(faults, "spec/hprotocol.md:5:", "hp-1-2 is cited in no test");
}

TEST(RuleCoverage, FindsACitationOfAnUnknownRule) {
  const auto faults = find_uncovered(planted({
      {"runtime/rpc/src/b.cpp", "\n// hp-1-4: gone\n"},
      {"tests/unit/b_test.cpp", "// hp-3\n"},
      {"spec/vectors/b.json", "[\"hp-2.2-1\"]"},
  }));
  EXPECT_EQ(faults.size(), 3u);
  expect_fault(faults, "runtime/rpc/src/b.cpp:2:", "hp-1-4");
  expect_fault(faults, "tests/unit/b_test.cpp:1:", "hp-3");
  expect_fault(faults, "spec/vectors/b.json:1:", "hp-2.2-1");
}

TEST(RuleCoverage, FindsAMustWithoutAnchorAndADuplicateAnchor) {
  const auto faults = find_uncovered(planted({
      {"spec/hprotocol.md", std::string(kPlantedPage) + "\nAlso it MUST be so.\n"
                                                        "| a | MUST |\n"
                                                        "- `[hp-1-3]` Again.\n"},
  }));
  EXPECT_EQ(faults.size(), 3u);
  expect_fault(faults, "spec/hprotocol.md:13:", "in no rule");
  expect_fault(faults, "spec/hprotocol.md:14:", "in no rule");
  expect_fault(faults, "spec/hprotocol.md:15:", "hp-1-3 stands here again");
}

TEST(RuleCoverage, AcceptsAnExemptionWithAReason) {
  const SourceFile only_code{"tests/unit/wire/a_test.cpp", "// hp-1-2\n"};
  EXPECT_EQ(find_uncovered(planted({only_code})).size(), 1u);
  EXPECT_TRUE(find_uncovered(planted({only_code,
                                      {"spec/exemptions.txt",
                                       "# A comment.\n\nhp-1-1 test: nothing can show it\n"}}))
                  .empty());
}

TEST(RuleCoverage, RefusesUnneededAndMalformedExemptions) {
  const auto faults = find_uncovered(planted({
      {"spec/exemptions.txt",
       "hp-1-1 test: it has one\n"
       "hp-1-3 code: a SHOULD needs none\n"
       "hp-7-1 code: no such rule\n"
       "hp-1-2 code:\n"
       "hp-1-2 both: no such place\n"},
  }));
  EXPECT_EQ(faults.size(), 5u);
  expect_fault(faults, "spec/exemptions.txt:1:", "hp-1-1 needs no such exemption");
  expect_fault(faults, "spec/exemptions.txt:2:", "hp-1-3 needs no such exemption");
  expect_fault(faults, "spec/exemptions.txt:3:", "does not have it");
  expect_fault(faults, "spec/exemptions.txt:4:", "write `anchor");
  expect_fault(faults, "spec/exemptions.txt:5:", "write `anchor");
}

}  // namespace
}  // namespace rtpm::spec
