#include "rtpm/wire/url.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "rtpm/wire/limits.hpp"

namespace rtpm::wire {
namespace {

struct GoodUrl {
  std::string text;
  std::vector<std::string> hosts;
  std::uint16_t port;
  std::string path;
};

class GoodUrls : public testing::TestWithParam<GoodUrl> {};

TEST_P(GoodUrls, AreTakenApart) {
  EXPECT_TRUE(is_url(GetParam().text));
  const auto url = parse_url(GetParam().text);
  ASSERT_TRUE(url);
  EXPECT_EQ(url->hosts, GetParam().hosts);
  EXPECT_EQ(url->port, GetParam().port);
  EXPECT_EQ(url->path, GetParam().path);
  EXPECT_EQ(url->text(), GetParam().text);
}

INSTANTIATE_TEST_SUITE_P(
    Url, GoodUrls,
    testing::Values(
        GoodUrl{"rtpm://127.0.0.1:7420/rtpm/names", {"127.0.0.1"}, 7420, "rtpm/names"},
        GoodUrl{"rtpm://robot-7.lab.example:1/a", {"robot-7.lab.example"}, 1, "a"},
        GoodUrl{"rtpm://host_a:65535/A.b-c_d/9", {"host_a"}, 65535, "A.b-c_d/9"},
        GoodUrl{"rtpm://[::1]:1/p", {"::1"}, 1, "p"}, GoodUrl{"rtpm://[::]:1/p", {"::"}, 1, "p"},
        GoodUrl{"rtpm://[2001:db8::1]:7420/p", {"2001:db8::1"}, 7420, "p"},
        GoodUrl{"rtpm://[1:2:3:4:5:6:7:8]:1/p", {"1:2:3:4:5:6:7:8"}, 1, "p"},
        GoodUrl{"rtpm://[FE80::ABCD]:1/p", {"FE80::ABCD"}, 1, "p"},
        GoodUrl{"rtpm://[1::]:1/p", {"1::"}, 1, "p"},
        GoodUrl{"rtpm://[::ffff:10.0.0.7]:1/p", {"::ffff:10.0.0.7"}, 1, "p"},
        GoodUrl{"rtpm://[fe80::1%25eth0]:1/p", {"fe80::1%eth0"}, 1, "p"},
        GoodUrl{"rtpm://10.0.0.7,[fd00::7],h:1/p", {"10.0.0.7", "fd00::7", "h"}, 1, "p"},
        GoodUrl{"rtpm://a,b,c,d,e,f,g,h:1/p", {"a", "b", "c", "d", "e", "f", "g", "h"}, 1, "p"},
        GoodUrl{"rtpm://h:80/" + std::string(kPathSizeMax, 'p'),
                {"h"},
                80,
                std::string(kPathSizeMax, 'p')}));

class BadUrls : public testing::TestWithParam<std::string> {};

// hp-10-1
TEST_P(BadUrls, AreNotTaken) {
  EXPECT_FALSE(parse_url(GetParam()));
}

INSTANTIATE_TEST_SUITE_P(
    Url, BadUrls,
    testing::Values("", "rtpm", "rtpm://", "rtpm:///", "rtpm://h", "rtpm://h/p", "rtpm://h:1",
                    "rtpm://h:1/", "rtpm://:1/p", "rtpm://h:/p", "rtpm://h:0/p", "rtpm://h:65536/p",
                    "rtpm://h:99999999999/p", "rtpm://h:-1/p", "rtpm://h:+1/p", "rtpm://h: 1/p",
                    "rtpm://h:1 /p", "rtpm://h:0x10/p", "rtpm://h:1a/p", "rtpm://h:1:2/p",
                    "RTPM://h:1/p", "http://h:1/p", " rtpm://h:1/p", "rtpm://h:1//p",
                    "rtpm://h:1/p/", "rtpm://h:1/a//b", "rtpm://h:1/a b", "rtpm://h:1/a?b",
                    "rtpm://h:1/\xc3\xa4", "rtpm://a b:1/p", "rtpm://u@h:1/p", "rtpm://::1:1/p",
                    "rtpm://[::1]/p", "rtpm://[::1]1/p", "rtpm://[::1:1/p", "rtpm://::1]:1/p",
                    "rtpm://[]:1/p", "rtpm://[:]:1/p", "rtpm://[:::]:1/p", "rtpm://[1::2::3]:1/p",
                    "rtpm://[12345::]:1/p", "rtpm://[g::]:1/p", "rtpm://[1:2:3:4:5:6:7]:1/p",
                    "rtpm://[1:2:3:4:5:6:7:8:9]:1/p", "rtpm://[1:2:3:4:5:6:7::8]:1/p",
                    "rtpm://[:1:2:3:4:5:6:7:8]:1/p", "rtpm://[1:2:3:4:5:6:7:8:]:1/p",
                    "rtpm://[::1.2.3]:1/p", "rtpm://[::1.2.3.256]:1/p", "rtpm://[::1.2.3.04]:1/p",
                    "rtpm://[1.2.3.4::]:1/p", "rtpm://[1.2.3.4]:1/p", "rtpm://[h]:1/p",
                    "rtpm://[[::1]]:1/p", "rtpm://[fe80::1%eth0]:1/p", "rtpm://[fe80::1%25]:1/p",
                    "rtpm://[fe80::1%25a%25]:1/p", "rtpm://[fe80::1%25abcdefghijklmnop]:1/p",
                    "rtpm://,h:1/p", "rtpm://h,:1/p", "rtpm://h,,g:1/p", "rtpm://h,[::1:1/p",
                    "rtpm://h, g:1/p", "rtpm://a,b,c,d,e,f,g,h,i:1/p",
                    "rtpm://h:1/" + std::string(kPathSizeMax + 1, 'p'),
                    std::string("rtpm://h:1/a\0b", 14), std::string("rtpm://h\0:1/a", 13)));

TEST(Url, IsToldFromAName) {
  EXPECT_TRUE(is_url("rtpm://h:1/p"));
  EXPECT_TRUE(is_url("http://h:1/p")) << "so that its text is about the URL and not about a name";
  EXPECT_FALSE(is_url("lab/arm0"));
  EXPECT_FALSE(is_url(""));
}

TEST(Path, IsComponentsPartedBySingleSlashes) {
  for (const char* good : {"a", "lab/arm0", "A/b/C/9", "a.b", "-", "_", ".", ".."}) {
    EXPECT_TRUE(is_valid_path(good)) << good;
  }
  for (const char* bad : {"", "/", "/a", "a/", "a//b", "a b", "a\n", "a:b", "a%b", "a\\b", "a+b"}) {
    EXPECT_FALSE(is_valid_path(bad)) << bad;
  }
  EXPECT_TRUE(is_valid_path(std::string(kPathSizeMax, 'a')));
  EXPECT_FALSE(is_valid_path(std::string(kPathSizeMax + 1, 'a')));
  EXPECT_FALSE(is_valid_path(std::string_view("a\0b", 3)));
}

TEST(Path, IsTheMoreSimilarTheMoreItsEndsAgree) {
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
