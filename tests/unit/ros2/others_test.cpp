// The messages beside those that rosbags wrote and rclpy of ROS 2 read (others_messages.py).

#include <gtest/gtest.h>

#include <fstream>
#include <map>
#include <string>

#include "example.hpp"

namespace rtpm::ros2 {
namespace {

struct Theirs {
  std::string hash;
  std::string bytes;  ///< As hexadecimal digits.
};

std::map<std::string, Theirs> others_messages() {
  std::map<std::string, Theirs> all;
  std::ifstream file(RTPM_OTHERS_MESSAGES);
  for (std::string type, hash, bytes; file >> type >> hash >> bytes;)
    all[type] = {hash, bytes};
  return all;
}

std::string hexadecimal(ConstBytes bytes) {
  std::string text;
  for (const std::byte byte : bytes) {
    text += "0123456789abcdef"[std::to_integer<unsigned>(byte >> 4)];
    text += "0123456789abcdef"[std::to_integer<unsigned>(byte & std::byte{15})];
  }
  return text;
}

std::vector<std::byte> bytes_of(const std::string& text) {
  std::vector<std::byte> bytes;
  for (std::size_t i = 0; i + 1 < text.size(); i += 2)
    bytes.push_back(static_cast<std::byte>(std::stoi(text.substr(i, 2), nullptr, 16)));
  return bytes;
}

template <class M>
class OthersTest : public testing::Test {};
template <class Tuple>
struct AsTypes;
template <class... M>
struct AsTypes<std::tuple<M...>> {
  using Types = testing::Types<M...>;
};
TYPED_TEST_SUITE(OthersTest, AsTypes<test::Messages>::Types);

TYPED_TEST(OthersTest, HasTheHashOfRos) {
  EXPECT_EQ(type_hash<TypeParam>(), others_messages().at(std::string(TypeParam::kType)).hash);
}

TYPED_TEST(OthersTest, EncodesAsRosDoes) {
  std::vector<std::byte> buffer;
  encode(test::example<TypeParam>(), buffer);
  EXPECT_EQ(hexadecimal(buffer), others_messages().at(std::string(TypeParam::kType)).bytes);
}

TYPED_TEST(OthersTest, DecodesMessagesOfRos) {
  const auto bytes = bytes_of(others_messages().at(std::string(TypeParam::kType)).bytes);
  const auto message = decode<TypeParam>(bytes);
  ASSERT_TRUE(message) << message.error();
  std::vector<std::byte> again;
  encode(*message, again);
  EXPECT_EQ(hexadecimal(again), hexadecimal(bytes));
}

TYPED_TEST(OthersTest, RefusesEachTruncation) {
  std::vector<std::byte> buffer;
  encode(test::example<TypeParam>(), buffer);
  for (std::size_t size = 0; size < buffer.size(); ++size)
    EXPECT_FALSE(decode<TypeParam>(ConstBytes(buffer).first(size))) << size;
  buffer.resize(buffer.size() + 3);
  EXPECT_TRUE(decode<TypeParam>(buffer));
  buffer.resize(buffer.size() + 1);
  EXPECT_EQ(decode<TypeParam>(buffer).error(), "it is longer than its type");
}

}  // namespace
}  // namespace rtpm::ros2
