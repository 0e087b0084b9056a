#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "host/keys.hpp"
#include "rtpm/access/files.hpp"
#include "rtpm/access/fingerprint.hpp"

namespace rtpm::tool {
namespace {

using rt::Finding;
using rt::Severity;

class KeyFindings : public testing::Test {
 protected:
  KeyFindings() {
    std::string name = (std::filesystem::temp_directory_path() / "rtpm-keys-XXXXXX").string();
    folder_ = ::mkdtemp(name.data());
    ::setenv("RTPM_KEYS", folder_.c_str(), 1);
  }
  ~KeyFindings() override { std::filesystem::remove_all(folder_); }

  void write(const char* name, const std::string& text, mode_t mode = 0600) const {
    const std::string path = folder_ + "/" + name;
    std::ofstream(path) << text;
    ::chmod(path.c_str(), mode);
  }
  [[nodiscard]] static Finding finding(const std::string& id) {
    const auto findings = survey_keys(Context());
    const auto found = std::ranges::find(findings, id, &Finding::id);
    EXPECT_NE(found, findings.end()) << id;
    return found == findings.end() ? Finding{} : *found;
  }

  std::string folder_;
  std::string server_ = "10.0.0.7 " + access::public_key_text(crypto::PublicKey{}) + "\n";
};

TEST_F(KeyFindings, AreGoodForAUserWithoutAny) {
  EXPECT_EQ(survey_keys(Context()).size(), 1U);
  EXPECT_EQ(finding("key").severity, Severity::kGood);
}

TEST_F(KeyFindings, AreGoodForWhatIsInOrder) {
  ASSERT_TRUE(access::make_key(folder_ + "/key", ""));
  write("known_servers", server_);
  write("authorized", "uid:7 role=observe on=**\n");
  for (const Finding& each : survey_keys(Context()))
    EXPECT_EQ(each.severity, Severity::kGood) << each.id << ": " << each.text;
  EXPECT_EQ(survey_keys(Context()).size(), 3U);
}

TEST_F(KeyFindings, SayThatServersAreKnownButThereIsNoKey) {
  write("known_servers", server_);
  EXPECT_EQ(finding("key").severity, Severity::kProblem);
  EXPECT_EQ(finding("key").remedy, "rtpm key new");
}

TEST_F(KeyFindings, SayThatOthersCanReadTheKey) {
  ASSERT_TRUE(access::make_key(folder_ + "/key", ""));
  ::chmod((folder_ + "/key").c_str(), 0640);
  EXPECT_EQ(finding("key").severity, Severity::kProblem);
  EXPECT_EQ(finding("key").remedy, "chmod 600 " + folder_ + "/key");
}

TEST_F(KeyFindings, PointAtFaultyLines) {
  write("known_servers", server_ + "10.0.0.8 rtpm25519 x\n");
  EXPECT_EQ(finding("known-servers").severity, Severity::kWarning);
  EXPECT_NE(finding("known-servers").text.find("known_servers:2:20: "), std::string::npos)
      << finding("known-servers").text;
  write("authorized", "uid:7 role=obsrve on=**\nbob\nuid:7 role=observe on=**\n");
  EXPECT_EQ(finding("grants").severity, Severity::kWarning);
  EXPECT_NE(finding("grants").text.find("authorized:1:12: "), std::string::npos)
      << finding("grants").text;
  EXPECT_NE(finding("grants").text.find("1 more"), std::string::npos);
  ::chmod((folder_ + "/authorized").c_str(), 0666);
  EXPECT_EQ(finding("grants").severity, Severity::kProblem);
}

}  // namespace
}  // namespace rtpm::tool
