#include <gtest/gtest.h>
#include <sys/stat.h>

#include <algorithm>
#include <cstdlib>

#include "host/keys.hpp"
#include "rtpm/access/files.hpp"
#include "rtpm/access/fingerprint.hpp"
#include "rtpm/test/temporary_folder.hpp"
#include "rtpm/test/text.hpp"

namespace rtpm::tool {
namespace {

using rt::Finding;
using rt::Severity;

class KeyFindings : public testing::Test {
 protected:
  KeyFindings() { ::setenv("RTPM_KEYS", folder_.path().c_str(), 1); }

  void write(const char* name, const std::string& text) const {
    ::chmod(folder_.write(name, text).c_str(), 0600);
  }
  [[nodiscard]] static Finding finding(const std::string& id) {
    const auto findings = survey_keys(Context());
    const auto found = std::ranges::find(findings, id, &Finding::id);
    EXPECT_NE(found, findings.end()) << id;
    return found == findings.end() ? Finding{} : *found;
  }

  const test::TemporaryFolder folder_;
  std::string server_ = "10.0.0.7 " + access::public_key_text(crypto::PublicKey{}) + "\n";
};

TEST_F(KeyFindings, AreGoodWithoutAnyFiles) {
  EXPECT_EQ(survey_keys(Context()).size(), 1U);
  EXPECT_EQ(finding("key").severity, Severity::kGood);
}

TEST_F(KeyFindings, AreGoodForValidFiles) {
  ASSERT_TRUE(access::make_key(folder_.file("key"), ""));
  write("known_servers", server_);
  write("authorized", "uid:7 role=observe on=**\n");
  for (const Finding& each : survey_keys(Context()))
    EXPECT_EQ(each.severity, Severity::kGood) << each.id << ": " << each.text;
  EXPECT_EQ(survey_keys(Context()).size(), 3U);
}

TEST_F(KeyFindings, ReportAMissingKey) {
  write("known_servers", server_);
  EXPECT_EQ(finding("key").severity, Severity::kProblem);
  EXPECT_EQ(finding("key").remedy, "rtpm key new");
}

TEST_F(KeyFindings, ReportAKeyThatOthersCanRead) {
  ASSERT_TRUE(access::make_key(folder_.file("key"), ""));
  ::chmod(folder_.file("key").c_str(), 0640);
  EXPECT_EQ(finding("key").severity, Severity::kProblem);
  EXPECT_EQ(finding("key").remedy, "chmod 600 " + folder_.file("key"));
}

TEST_F(KeyFindings, PointAtFaultyLines) {
  write("known_servers", server_ + "10.0.0.8 rtpm25519 x\n");
  EXPECT_EQ(finding("known-servers").severity, Severity::kWarning);
  test::expect_text(finding("known-servers").text, {"known_servers:2:20: "});
  write("authorized", "uid:7 role=obsrve on=**\nbob\nuid:7 role=observe on=**\n");
  EXPECT_EQ(finding("grants").severity, Severity::kWarning);
  test::expect_text(finding("grants").text, {"authorized:1:12: ", "1 more"});
  ::chmod(folder_.file("authorized").c_str(), 0666);
  EXPECT_EQ(finding("grants").severity, Severity::kProblem);
}

}  // namespace
}  // namespace rtpm::tool
