#include "web/request_rules.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "configuration.hpp"
#include "rtpm/test/temporary_folder.hpp"
#include "rtpm/test/text.hpp"
#include "web/token.hpp"

namespace rtpm::console {
namespace {

namespace fs = std::filesystem;

TEST(RequestTargets, AreSplitAndDecoded) {
  const auto target = read_target("/a%20b/c.js?x=1&token=T%2D1&y");
  ASSERT_TRUE(target);
  EXPECT_EQ(target->path, "/a b/c.js");
  EXPECT_EQ(target->token, "T-1");
  EXPECT_EQ(read_target("/")->path, "/");
  EXPECT_EQ(read_target("/?")->token, "");
  EXPECT_EQ(read_target("/gateway?to=%5B%3A%3A1%5D:4711&token=T")->to, "[::1]:4711");
  EXPECT_EQ(read_target("/gateway?to&tokens=T&too=1")->to, "");
}

TEST(RequestTargets, AreRefusedIfMalformed) {
  for (const std::string target :
       {"", "x", "http://evil/", "/%", "/%4", "/%zz", "/%00", "/a%0ab", "/?token=%0d%0a"}) {
    EXPECT_FALSE(read_target(target)) << target;
  }
  EXPECT_FALSE(read_target("/" + std::string(5000, 'a')));
}

TEST(Subprotocols, AreFoundAsWholeWords) {
  EXPECT_TRUE(offers_subprotocol("a, rtpm.stream.v1 ,b", "rtpm.stream.v1"));
  for (const char* offered : {"", "rtpm.stream.v10", "rtpm.stream", "a rtpm.stream.v1"}) {
    EXPECT_FALSE(offers_subprotocol(offered, "rtpm.stream.v1")) << offered;
  }
}

TEST(Hosts, AreThisServersOrRefused) {
  const std::vector<std::string> names{"robot.lab", "192.168.1.9"};
  // An SSH tunnel may use any port.
  for (const char* host :
       {"localhost", "localhost:8765", "localhost:9000", "127.0.0.1:8765", "LOCALHOST:8765",
        "[::1]:8765", "[::1]", "192.168.1.9:8765", "Robot.Lab:8765", "robot.lab"}) {
    EXPECT_TRUE(is_own_host(host, names)) << host;
  }
  for (const char* host :
       {"", ":8765", "evil.com", "evil.com:8765", "localhost.evil.com", "localhost:", "localhost:x",
        "localhost:123456", "localhost:80:80", "127.0.0.1.evil.com", "192.168.1.8:8765",
        "127.0.0.1:8765@evil.com", "robot", "[::1", "::1", "[::1]x:1"}) {
    EXPECT_FALSE(is_own_host(host, names)) << host;
  }
  EXPECT_TRUE(is_own_host("[fe80::1]:8765", std::vector<std::string>{"fe80::1"}));
}

TEST(Origins, AreThisPageOrRefused) {
  EXPECT_TRUE(is_own_origin("http://127.0.0.1:8765", "127.0.0.1:8765"));
  for (const char* origin : {"", "null", "http://evil.com", "https://127.0.0.1:8765",
                             "http://127.0.0.1:8766", "http://127.0.0.1:8765.evil.com"}) {
    EXPECT_FALSE(is_own_origin(origin, "127.0.0.1:8765")) << origin;
  }
}

TEST(Subprotocols, AreChosenByTheServersPreference) {
  EXPECT_EQ(choose_subprotocol("foxglove.websocket.v1, foxglove.sdk.v1"), "foxglove.sdk.v1");
  EXPECT_EQ(choose_subprotocol(" foxglove.websocket.v1 "), "foxglove.websocket.v1");
  EXPECT_EQ(choose_subprotocol(""), "");
  EXPECT_EQ(choose_subprotocol("foxglove.sdk.v2,mqtt"), "");
  EXPECT_EQ(choose_subprotocol(",,,foxglove.sdk.v1"), "foxglove.sdk.v1");
}

TEST(ContentSecurityPolicies, OmitMalformedHosts) {
  test::expect_text(content_security_policy("127.0.0.1:8765"), {"ws://127.0.0.1:8765"});
  EXPECT_EQ(content_security_policy("evil; script-src *").find("evil"), std::string::npos);
}

class PageFiles : public testing::Test {
 protected:
  PageFiles() {
    fs::create_directories(root_ / "page/assets");
    for (const char* file : {"page/index.html", "page/assets/a.js", "page/.hidden", "secret.txt"})
      std::ofstream(root_ / file) << "x";
    fs::create_symlink(root_ / "secret.txt", root_ / "page/link.txt");
  }
  [[nodiscard]] std::string find(std::string_view path) const {
    const auto file = find_page_file(root_ / "page", path);
    return file ? fs::relative(*file, fs::canonical(root_)).string() : "";
  }

  const test::TemporaryFolder folder_;
  const fs::path root_ = folder_.path();
};

TEST_F(PageFiles, AreFoundBelowTheFolder) {
  EXPECT_EQ(find("/"), "page/index.html");
  EXPECT_EQ(find("/index.html"), "page/index.html");
  EXPECT_EQ(find("/assets/a.js"), "page/assets/a.js");
}

TEST_F(PageFiles, AreNotFoundElsewhere) {
  for (const char* path : {"", "index.html", "/../secret.txt", "/assets/../../secret.txt",
                           "/./index.html", "//index.html", "/assets//a.js", "/.hidden",
                           "/link.txt", "/assets", "/none", "/..\\secret.txt", "/etc/passwd"}) {
    EXPECT_EQ(find(path), "") << path;
  }
}

TEST(Tokens, AreLongRandomAndCompared) {
  const auto one = make_token();
  const auto other = make_token();
  ASSERT_TRUE(one && other);
  EXPECT_EQ(one->size(), 48U);
  EXPECT_NE(*one, *other);
  EXPECT_TRUE(is_same_token(*one, std::string(*one)));
  EXPECT_FALSE(is_same_token(*one, *other));
  EXPECT_FALSE(is_same_token(*one, one->substr(1)));
  EXPECT_FALSE(is_same_token(*one, ""));
}

class TokenFiles : public testing::Test {
 protected:
  void write(const std::string& text, fs::perms mode) const {
    std::ofstream(path_) << text;
    fs::permissions(path_, mode);
  }

  const test::TemporaryFolder folder_;
  const std::string path_ = folder_.file("token");
};

TEST_F(TokenFiles, AreCreatedOnceForThisUserAlone) {
  const auto made = token_in_file(path_);
  ASSERT_TRUE(made) << made.error().text();
  EXPECT_TRUE(is_token(*made));
  EXPECT_EQ(fs::status(path_).permissions(), fs::perms::owner_read | fs::perms::owner_write);
  const auto kept = token_in_file(path_);
  ASSERT_TRUE(kept) << kept.error().text();
  EXPECT_EQ(*kept, *made);
}

TEST_F(TokenFiles, AreRefusedIfInvalidOrReadableByOthers) {
  constexpr fs::perms kOwn = fs::perms::owner_read | fs::perms::owner_write;
  write("0123456789abcdef", kOwn);
  EXPECT_EQ(token_in_file(path_).value(), "0123456789abcdef");
  write("0123456789abcdef", kOwn | fs::perms::others_read);
  test::expect_text(token_in_file(path_).error().text(), {"chmod 600"});
  for (const std::string& text :
       {std::string(), std::string("short\n"), std::string("0123456789abcdef\n\n"),
        std::string(5000, 'a'), std::string("0123456789abcde/")}) {
    write(text, kOwn);
    EXPECT_FALSE(token_in_file(path_)) << text;
  }
  fs::remove(path_);
  fs::create_directory(path_);
  EXPECT_FALSE(token_in_file(path_));
  EXPECT_FALSE(token_in_file("/nowhere/token"));
}

TEST(Addresses, NeedNoConsentIfLoopback) {
  EXPECT_TRUE(is_loopback("127.0.0.1"));
  EXPECT_TRUE(is_loopback("::1"));
  for (const char* address : {"0.0.0.0", "::", "192.168.1.9", "", "1127.0.0.1"})
    EXPECT_FALSE(is_loopback(address)) << address;
}

}  // namespace
}  // namespace rtpm::console
