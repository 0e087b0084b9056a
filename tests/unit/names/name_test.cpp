#include "model/name.hpp"

#include <gtest/gtest.h>

#include <string>

namespace rtpm::names {
namespace {

TEST(Name, IsAcceptedWithinTheLimits) {
  const std::string longest =
      std::string(64, 'a') + '/' + std::string(64, 'b') + '/' + std::string(64, 'c') + "/d/e/f";
  ASSERT_EQ(longest.size(), kNameSizeMax);
  for (const std::string& name :
       {std::string("a"), std::string("lab/arm0"), std::string("A.b_c-9"), std::string("./.."),
        std::string("1/2/3/4/5/6/7/8"), std::string(64, 'x'), longest}) {
    EXPECT_EQ(first_bad_component(name), std::nullopt) << name;
  }
}

TEST(Name, IsRefusedWithTheBadComponent) {
  struct Case {
    std::string name;
    int component;
  };
  const std::string c64(64, 'a');
  std::string three = c64;
  three.append("/").append(c64).append("/").append(c64);
  for (const Case& bad : {
           Case{"", 0},
           Case{"/", 0},
           Case{"/lab", 0},
           Case{"lab/", 1},
           Case{"lab//arm", 1},
           Case{"lab/arm 0", 1},
           Case{"a/b/c\n", 2},
           Case{"a/b/\xc3\xa4", 2},
           Case{std::string("a/b\0c", 5), 1},
           Case{"a/b:c", 1},
           Case{"a/\\", 1},
           Case{c64 + "x", 0},
           Case{"a/" + c64 + "x/b", 1},
           Case{"1/2/3/4/5/6/7/8/9", 8},
           Case{std::string(100'000, '/'), 0},
           Case{"a" + std::string(100'000, '/'), 1},
           Case{std::string(100'000, 'a'), 0},
           Case{three + "/d/e/fg", 5},
           Case{three + "/ddddddd", 3},
       }) {
    EXPECT_EQ(first_bad_component(bad.name), bad.component) << bad.name.substr(0, 250);
  }
}

TEST(Url, HasSchemeHostPortAndPath) {
  const std::string longest = "rtpm://255.255.255.255:65535/" + std::string(200, 'p');
  std::string several = "rtpm://";
  for (int i = 0; i < 8; ++i)
    several += (i > 0 ? "," : "") + std::string("[2001:1db8:1111:2222:3333:4444:5555:6666]");
  several += ":65535/" + std::string(200, 'p');
  for (const std::string& url : {std::string("rtpm://127.0.0.1:4711/lab/arm0"),
                                 std::string("rtpm://h:1/p"), std::string("rtpm://arm-pc.lab:9/p"),
                                 std::string("rtpm://10.0.0.7,[fd00::7]:1/p"), several, longest}) {
    EXPECT_TRUE(is_url(url)) << url;
  }
  for (const std::string& text :
       {std::string(""), std::string("rtpm://"), std::string("http://h:1/p"),
        std::string("rtpm://h/p"), std::string("rtpm://:1/p"), std::string("rtpm://h:0/p"),
        std::string("rtpm://h:65536/p"), std::string("rtpm://h:1"), std::string("rtpm://h:1/"),
        std::string("rtpm://h:1x/p"), std::string("rtpm://h:/p"), std::string("rtpm://h:1/p p"),
        std::string("rtpm://h:1/p\n"), std::string("rtpm://h:1/\xff"),
        std::string("rtpm://h:1/") + std::string(kUrlSizeMax, 'p')}) {
    EXPECT_FALSE(is_url(text)) << text;
  }
}

TEST(Interface, IsAQualifiedName) {
  for (const char* const name : {"Arm", "lab.Arm", "rtpm.device.Device_2", "_a"}) {
    EXPECT_TRUE(is_interface(name)) << name;
  }
  for (const std::string& text :
       {std::string(""), std::string("."), std::string("lab."), std::string(".Arm"),
        std::string("lab..Arm"), std::string("lab.2"), std::string("lab Arm"),
        std::string("lab/Arm"), std::string(kInterfaceSizeMax + 1, 'a')}) {
    EXPECT_FALSE(is_interface(text)) << text;
  }
}

}  // namespace
}  // namespace rtpm::names
