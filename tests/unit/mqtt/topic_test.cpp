#include "topic.hpp"

#include <gtest/gtest.h>

// Topics and their meaning (ev-6.1).
namespace rtpm::mqtt {
namespace {

TEST(Topic, ConvertsToTypeAndSourceAndBack) {
  EXPECT_EQ(topic_of("rtpm", {5, 2}), "rtpm/5/2");
  EXPECT_EQ(origin_of("rtpm", "rtpm/5/2"), (Origin{5, 2}));
  EXPECT_EQ(origin_of("site/a", topic_of("site/a", {0x7fff'ffff, 0xffff'ffff})),
            (Origin{0x7fff'ffff, 0xffff'ffff}));
  EXPECT_EQ(origin_of("rtpm", "rtpm/5/0"), (Origin{5, 0}));
}

// ev-6.1-1
TEST(Topic, IsRefusedIfMalformed) {
  for (const char* const topic :
       {"", "rtpm", "rtpm/", "rtpm/5", "rtpm/5/", "rtpm//2", "rtpm/0/2", "rtpm/2147483648/1",
        "rtpm/5/4294967296", "rtpm/05/2", "rtpm/5/02", "rtpm/-5/2", "rtpm/5/2/3", "rtpmx/5/2",
        "other/5/2", "rtpm/5 /2", "rtpm/a/2"}) {
    EXPECT_FALSE(origin_of("rtpm", topic)) << topic;
  }
}

TEST(Topic, SelectionIsATypeWithOrWithoutASource) {
  const auto type = parse_wanted("5");
  ASSERT_TRUE(type);
  EXPECT_EQ(type->type, 5U);
  EXPECT_FALSE(type->source);
  const auto both = parse_wanted("5/2");
  ASSERT_TRUE(both);
  EXPECT_EQ(both->source, 2U);
  for (const char* const text : {"", "0", "x", "5/", "5/x", "2147483648", "/2"}) {
    const auto refused = parse_wanted(text);
    ASSERT_FALSE(refused) << text;
    EXPECT_NE(refused.error().what.find("'" + std::string(text) + "'"), std::string::npos);
  }
}

TEST(Topic, MappingIsATopicWithTypeAndSource) {
  EXPECT_EQ(parse_mapping("lab/temperature=100/3").value(),
            (TopicMapping{"lab/temperature", {100, 3}}));
  EXPECT_EQ(parse_mapping("a=b=1/2").value(), (TopicMapping{"a=b", {1, 2}}));
  for (const char* const text :
       {"", "=1/2", "lab", "lab=", "lab=1", "lab=0/1", "lab/+=1/2", "lab/#=1/2"}) {
    EXPECT_FALSE(parse_mapping(text)) << text;
  }
}

}  // namespace
}  // namespace rtpm::mqtt
