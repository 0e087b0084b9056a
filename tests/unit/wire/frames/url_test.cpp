#include "rtpm/wire/url.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "rtpm/wire/limits.hpp"

// Addresses and paths, beyond the cases of spec/vectors/urls.json.
namespace rtpm::wire {
namespace {

TEST(Url, KeepsItsHostAndItsText) {
  for (const auto& [text, host] : {std::pair{"rtpm://host_a:1/p", "host_a"},
                                   {"rtpm://[::1]:1/p", "::1"},
                                   {"rtpm://[::]:1/p", "::"},
                                   {"rtpm://[1:2:3:4:5:6:7:8]:1/p", "1:2:3:4:5:6:7:8"},
                                   {"rtpm://[FE80::ABCD]:1/p", "FE80::ABCD"},
                                   {"rtpm://[1::]:1/p", "1::"}}) {
    const auto url = parse_url(text);
    ASSERT_TRUE(url) << text;
    EXPECT_EQ(url->hosts, std::vector<std::string>{host});
    EXPECT_EQ(url->text(), text);
  }
}

// hp-10-1
TEST(Url, IsRefusedIfMalformed) {
  const std::vector<std::string> all{"rtpm",
                                     "rtpm:///",
                                     "rtpm://h:99999999999/p",
                                     "rtpm://h:1 /p",
                                     "rtpm://a b:1/p",
                                     "rtpm://[::1]1/p",
                                     "rtpm://::1]:1/p",
                                     "rtpm://[:]:1/p",
                                     "rtpm://[g::]:1/p",
                                     "rtpm://[1:2:3:4:5:6:7:8:9]:1/p",
                                     "rtpm://[:1:2:3:4:5:6:7:8]:1/p",
                                     "rtpm://[1:2:3:4:5:6:7:8:]:1/p",
                                     "rtpm://[::1.2.3]:1/p",
                                     "rtpm://[::1.2.3.04]:1/p",
                                     "rtpm://[1.2.3.4::]:1/p",
                                     "rtpm://[h]:1/p",
                                     "rtpm://[[::1]]:1/p",
                                     "rtpm://[fe80::1%25a%25]:1/p",
                                     "rtpm://[fe80::1%25abcdefghijklmnop]:1/p",
                                     "rtpm://h,,g:1/p",
                                     "rtpm://h,[::1:1/p",
                                     "rtpm://h, g:1/p",
                                     std::string("rtpm://h:1/a\0b", 14),
                                     std::string("rtpm://h\0:1/a", 13)};
  for (const std::string& bad : all) {
    EXPECT_FALSE(parse_url(bad)) << bad;
  }
}

TEST(Url, DiffersFromAName) {
  EXPECT_TRUE(is_url("rtpm://h:1/p"));
  EXPECT_TRUE(is_url("http://h:1/p")) << "so that its text is about the URL and not about a name";
  EXPECT_FALSE(is_url("lab/arm0"));
  EXPECT_FALSE(is_url(""));
}

TEST(Path, ConsistsOfComponentsBetweenSingleSlashes) {
  for (const char* good : {"a", "lab/arm0", "A/b/C/9", "a.b", "-", "_", ".", ".."}) {
    EXPECT_TRUE(is_valid_path(good)) << good;
  }
  for (const char* bad : {"", "/", "/a", "a/", "a//b"}) {
    EXPECT_FALSE(is_valid_path(bad)) << bad;
  }
  EXPECT_TRUE(is_valid_path(std::string(kPathSizeMax, 'a')));
  EXPECT_FALSE(is_valid_path(std::string(kPathSizeMax + 1, 'a')));
}

TEST(Path, IsMoreSimilarTheMoreItsEndsAgree) {
  EXPECT_EQ(similarity("lab/arm0", "lab/arm0"), 8u);
  EXPECT_EQ(similarity("lab/arm0", "lab/arm1"), 7u);
  EXPECT_EQ(similarity("lab/arm0", "lab/arm"), 7u);
  EXPECT_EQ(similarity("lb/arm0", "lab/arm0"), 7u) << "no byte counts twice";
  EXPECT_EQ(similarity("aaa", "aaaaa"), 3u);
  EXPECT_EQ(similarity("lab/arm0", "rtpm/names"), 0u);
  EXPECT_EQ(similarity("", "lab"), 0u);
}

// Tests each of the 256 bytes alone: the alphabet is exactly the spec's (hp-10).
TEST(Path, HasTheSpecsAlphabet) {
  const std::string alphabet = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789._-";
  for (int c = 0; c < 256; ++c) {
    const std::string text(1, static_cast<char>(c));
    EXPECT_EQ(is_valid_path(text), alphabet.find(text) != alphabet.npos) << c;
  }
}

}  // namespace
}  // namespace rtpm::wire
