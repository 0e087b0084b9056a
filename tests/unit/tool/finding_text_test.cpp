#include "host/finding_text.hpp"

#include <gtest/gtest.h>

#include <sstream>

#include "host/wake_up.hpp"
#include "rtpm/test/text.hpp"

namespace rtpm::tool {
namespace {

using rt::Finding;
using rt::Severity;

std::vector<Finding> several() {
  return {{"kernel", Severity::kGood, "it is a real-time kernel"},
          {"swap", Severity::kWarning, "there is some", "some ms", "sudo swapoff -a"},
          {"clock", Severity::kGood, "'tsc'"},
          {"realtime", Severity::kProblem, "it is refused", "nothing bounds a delay",
           "echo 'a long line that is to be pasted as it is' | sudo tee /etc/somewhere.conf\n"
           "then log in again"}};
}

TEST(Findings, AreSortedBySeverityWithCostAndRemedy) {
  EXPECT_EQ(text_of(several(), false, 60),
            "1 problem, 1 warning, 0 notes, 2 good\n\n"
            "problem  realtime: it is refused\n"
            "         cost    nothing bounds a delay\n"
            "         remedy  echo 'a long line that is to be pasted as it is' | sudo tee "
            "/etc/somewhere.conf\n"
            "                 then log in again\n\n"
            "warning  swap: there is some\n"
            "         cost    some ms\n"
            "         remedy  sudo swapoff -a\n\n"
            "good     kernel, clock\n");
}

TEST(Findings, IncludeGoodOnesOnRequest) {
  const std::string text = text_of(several(), true, 60);
  EXPECT_TRUE(text.ends_with("good     kernel: it is a real-time kernel\ngood     clock: 'tsc'\n"))
      << text;
}

TEST(Findings, FitATerminalOfAnyWidth) {
  std::vector<Finding> findings = several();
  findings[1].text = "one two three four five six seven eight nine ten eleven twelve thirteen";
  std::istringstream lines(text_of(findings, false, 50));
  for (std::string line; std::getline(lines, line);)
    EXPECT_TRUE(line.size() <= 50 || line.find("sudo") != std::string::npos) << line;
}

TEST(Findings, EscapeForeignText) {
  std::vector<Finding> findings = several();
  findings[3].text = "\x1b[2Jhello";
  const std::string text = text_of(findings, false, 60);
  EXPECT_EQ(text.find('\x1b'), std::string::npos) << text;
}

TEST(Changes, ShowOldAndNewValuesAndHowToKeepThem) {
  FindingReport report;
  EXPECT_EQ(text_of_changes(report), "nothing to fix\n");
  report.changes = {{"/proc/a", "1", "2"}, {"/proc/b", "3", "4", "Permission denied"}};
  report.lastings = {"echo a=2 | sudo tee /etc/a"};
  EXPECT_EQ(text_of_changes(report),
            "changed      /proc/a from 1 to 2\n"
            "not changed  /proc/b from 3 to 4: Permission denied\n"
            "until the host starts anew; to make it last:\n"
            "  echo a=2 | sudo tee /etc/a\n");
  report.is_dry = true;
  EXPECT_TRUE(text_of_changes(report).starts_with("would change /proc/a from 1 to 2\n"));
}

TEST(Changes, AreInJsonWithTheFindingsTheyFixed) {
  FindingReport report{.findings = several(), .fixed_ids = {"clock"}};
  report.changes = {{"/proc/a", "1", "2"}, {"/proc/b", "3", "4", "Permission denied"}};
  const Json findings = json_of_findings(report);
  EXPECT_EQ(findings[0]["fixed"], false);
  EXPECT_EQ(findings[2]["fixed"], true);
  EXPECT_EQ(findings[3]["severity"], "problem");
  const Json changes = json_of_changes(report);
  EXPECT_EQ(changes[0]["is_made"], true);
  EXPECT_FALSE(changes[0].contains("problem"));
  EXPECT_EQ(changes[1]["is_made"], false);
  EXPECT_EQ(changes[1]["problem"], "Permission denied");
  report.is_dry = true;
  EXPECT_EQ(json_of_changes(report)[0]["is_made"], false);
}

/// Wake-ups, one in a hundred of which was late by `late`.
WakeUps wake_ups(Duration late) {
  WakeUps measured;
  for (int i = 0; i < 1000; ++i)
    measured.lateness.record(i % 100 == 0 ? late : std::chrono::microseconds{5});
  return measured;
}

TEST(WakeUpVerdict, JudgesWhetherA1KhzLoopHasTimeLeft) {
  using std::chrono::microseconds;
  EXPECT_EQ(judge(wake_ups(microseconds{60})).severity, Severity::kGood);
  const Finding warning = judge(wake_ups(microseconds{600}));
  EXPECT_EQ(warning.severity, Severity::kWarning) << warning.text;
  const Finding problem = judge(wake_ups(microseconds{4000}));
  EXPECT_EQ(problem.severity, Severity::kProblem) << problem.text;
  test::expect_text(problem.cost, {"loses a cycle"});
  EXPECT_NE(problem.remedy, "");
}

}  // namespace
}  // namespace rtpm::tool
