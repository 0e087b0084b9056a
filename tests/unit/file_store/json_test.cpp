#include "rtpm/file_store/json.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <string>

#include "folder.hpp"
#include "rtpm/file_store/file_storage.hpp"

namespace rtpm::file_store {
namespace {

TEST(Json, MovesPermanentNamesBetweenRegistries) {
  names::StoredName leased = permanent("lab/leased", 2);
  leased.lease = std::chrono::seconds{2};
  const std::string text = to_json({permanent("lab/arm0", 1), leased});
  const auto names = parse_json(text, {42, 1});
  ASSERT_TRUE(names) << names.error().text();
  ASSERT_EQ(names->size(), 1u);
  const Folder folder;
  {
    const auto storage = make_file_storage(folder.file());
    const auto count = names::import_names(*storage, *names, {});
    ASSERT_TRUE(count) << count.error().text();
    EXPECT_EQ(*count, 1u);
  }
  const auto storage = make_file_storage(folder.file());
  const auto content = storage->load();
  ASSERT_TRUE(content);
  ASSERT_EQ(content->names.size(), 1u);
  EXPECT_EQ(content->names[0].properties, permanent("lab/arm0", 1).properties);
  EXPECT_EQ(content->names[0].owner.id, 42u);
  EXPECT_EQ(to_json(content->names), text);
}

TEST(Json, DescribesMistakes) {
  const auto refusal_of = [](const char* text) {
    const auto names = parse_json(text, {1, 1});
    EXPECT_FALSE(names) << text;
    return names ? std::string() : names.error().text();
  };
  test::expect_text(refusal_of("{"), {"no JSON object"});
  test::expect_text(refusal_of(R"({"names": []})"), {"version is not 1"});
  test::expect_text(refusal_of(R"({"version": 1})"), {"no list 'names'"});
  test::expect_text(refusal_of(R"({"version": 1, "names": [3]})"), {"entry 1 of 'names'"});
  test::expect_text(refusal_of(R"({"version": 1, "names": [{"properties":
      [{"name": "a", "type": "real", "value": "x"}]}]})"),
                    {"properties of another form"});
}

TEST(Json, FollowsTheRulesOfNames) {
  const Folder folder;
  const auto storage = make_file_storage(folder.file());
  const auto names = parse_json(R"({"version": 1, "names": [
      {"name": "lab/arm0", "url": "rtpm://h:1/p", "interface": "lab.Arm"},
      {"name": "lab//arm1", "url": "rtpm://h:1/p", "interface": "lab.Arm"}]})",
                                {1, 1});
  ASSERT_TRUE(names);
  const auto refused = names::import_names(*storage, *names, {});
  ASSERT_FALSE(refused);
  test::expect_text(refused.error().text(), {"after 1 names, component 2 of the name 'lab//arm1'"});
}

}  // namespace
}  // namespace rtpm::file_store
