#include "rtpm/access/files.hpp"

#include <gtest/gtest.h>

#include <fstream>

#include "rights.hpp"
#include "rtpm/test/temporary_folder.hpp"

namespace rtpm::access {
namespace {

class Files : public testing::Test {
 protected:
  [[nodiscard]] std::string path(const char* name) const { return folder_.file(name); }
  void write(const char* name, const std::string& text) const {
    std::ofstream(path(name), std::ios::binary) << text;
    keep_for_this_user(path(name));
  }

  test::TemporaryFolder folder_;
};

TEST_F(Files, ReadsTheKeyThatItMade) {
  const auto made = make_key(path("sub/key"), "alice@lab");
  ASSERT_TRUE(made) << made.error().text();
  EXPECT_FALSE(are_others_allowed(path("sub/key")));
  EXPECT_FALSE(are_others_allowed(path("sub")));
  const auto read = read_key(path("sub/key"));
  ASSERT_TRUE(read) << read.error().text();
  EXPECT_EQ(read->public_key, made->public_key);
}

TEST_F(Files, RefusesToReplaceAKey) {
  const auto first = make_key(path("key"), "");
  ASSERT_TRUE(first);
  const auto second = make_key(path("key"), "");
  ASSERT_FALSE(second);
  EXPECT_NE(second.error().text().find("there is one already"), std::string::npos);
  EXPECT_EQ(read_key(path("key"))->public_key, first->public_key);
}

TEST_F(Files, RefusesAKeyThatOthersCanReadAndNamesTheRemedy) {
  ASSERT_TRUE(make_key(path("key"), ""));
  for (const auto& let : {let_others_read, let_others_write}) {
    keep_for_this_user(path("key"));
    const auto own = read_key(path("key"));
    ASSERT_TRUE(own) << own.error().text();
    let(path("key"));
    const auto read = read_key(path("key"));
    ASSERT_FALSE(read);
    EXPECT_NE(read.error().text().find(kRemedyOfReading), std::string::npos) << read.error().text();
    EXPECT_NE(read.error().text().find(path("key")), std::string::npos);
  }
}

TEST_F(Files, RefusesAFileThatHoldsNoKey) {
  const auto missing = read_key(path("key"));
  ASSERT_FALSE(missing);
  EXPECT_NE(missing.error().text().find("rtpm key new"), std::string::npos);
  write("empty", "");
  EXPECT_FALSE(read_key(path("empty")));
  write("broken", "rtpm25519 AAAA\n");
  EXPECT_FALSE(read_key(path("broken")));
  EXPECT_FALSE(read_key(folder_.path()));
}

TEST_F(Files, ReadsAMissingFileOfGrantsAsEmpty) {
  const auto read = read_trusted_file(path("authorized"));
  ASSERT_TRUE(read);
  EXPECT_TRUE(read->empty());
}

TEST_F(Files, RefusesGrantsThatOthersCanWrite) {
  write("authorized", "uid:1 role=observe on=**\n");
  let_others_read(path("authorized"));
  EXPECT_TRUE(read_trusted_file(path("authorized")));
  let_others_write(path("authorized"));
  const auto read = read_trusted_file(path("authorized"));
  ASSERT_FALSE(read);
  EXPECT_NE(read.error().text().find(kRemedyOfWriting), std::string::npos) << read.error().text();
}

TEST_F(Files, RefusesAFileThatIsTooLarge) {
  write("authorized", std::string(kFileSizeMax + 1, 'x'));
  EXPECT_FALSE(read_trusted_file(path("authorized")));
}

TEST_F(Files, AreToldApartByTheirStamps) {
  EXPECT_FALSE(stamp_of(path("authorized")).is_of_file());
  write("authorized", "one");
  const FileStamp first = stamp_of(path("authorized"));
  EXPECT_TRUE(first.is_of_file());
  EXPECT_EQ(first, stamp_of(path("authorized")));
  write("authorized", "another");
  EXPECT_NE(first, stamp_of(path("authorized")));
}

TEST_F(Files, HaveNamesWithBlanksAndUmlauts) {
  const auto made = make_key(path("Schlüssel im Büro/key of Jörg"), "");
  ASSERT_TRUE(made) << made.error().text();
  EXPECT_EQ(read_key(path("Schlüssel im Büro/key of Jörg"))->public_key, made->public_key);
}

TEST(ThisUser, IsNamedWithTheHost) {
  const std::string name = user_at_host();
  EXPECT_GT(name.find('@'), 0u);
  EXPECT_LT(name.find('@') + 1, name.size());
}

TEST_F(Files, ReadsTheCommentBehindTheKey) {
  ASSERT_TRUE(make_key(path("key"), "alice@lab, new"));
  EXPECT_EQ(key_comment(path("key")), "alice@lab, new");
  ASSERT_TRUE(make_key(path("bare"), ""));
  EXPECT_EQ(key_comment(path("bare")), "");
  let_others_read(path("key"));
  EXPECT_EQ(key_comment(path("key")), "");
}

}  // namespace
}  // namespace rtpm::access
