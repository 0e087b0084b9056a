#include "rtpm/vrpn/message.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <string>
#include <string_view>

#include "rtpm/vrpn/payload.hpp"

// Messages against bytes that VRPN's own server (07.38) sent.
namespace rtpm::vrpn {
namespace {

std::vector<std::byte> bytes_of(std::string_view hex) {
  std::vector<std::byte> bytes;
  for (std::size_t i = 0; i + 1 < hex.size(); i += 2)
    bytes.push_back(static_cast<std::byte>(std::stoi(std::string(hex.substr(i, 2)), nullptr, 16)));
  return bytes;
}

// Sender 1 is "Tracker0", at 1795726304 s and 751556 us, the second message.
constexpr std::string_view kTracker0 =
    "00000025"
    "6b089be0"
    "000b77c4"
    "00000001"
    "ffffffff"
    "00000001"
    "00000009547261636b65723000"
    "000000";
// A pose of sensor 1: no translation, no rotation.
constexpr std::string_view kPose =
    "0000000100000001000000000000000000000000000000000000000000000000000000000000000000000000000000"
    "0000000000000000003ff0000000000000";

TEST(Cookies, AreThoseOfVersion7) {
  const auto ours = cookie();
  EXPECT_TRUE(is_cookie(ours));
  EXPECT_TRUE(is_cookie(bytes_of("7672706e3a207665722e2030372e333520203000000000000000")));
  EXPECT_FALSE(is_cookie(bytes_of("7672706e3a207665722e2030382e333520203000000000000000")));
  EXPECT_FALSE(is_cookie(ConstBytes(ours).first(kCookieSize - 1)));
}

TEST(Messages, HaveTheBytesOfVrpnsServer) {
  const auto wanted = bytes_of(kTracker0);
  std::vector<std::byte> made;
  const Payload payload = name_payload("Tracker0");
  append(made,
         {.sender = 1,
          .type = kSenderDescription,
          .time_us = 1'795'726'304LL * 1'000'000 + 751'556,
          .payload = payload},
         1);
  EXPECT_EQ(made, wanted);
  Parser parser;
  for (const std::byte byte : wanted) {
    EXPECT_FALSE(parser.next());
    parser.push(ConstBytes(&byte, 1));
  }
  const auto read = parser.next();
  ASSERT_TRUE(read);
  EXPECT_EQ(read->sender, 1);
  EXPECT_EQ(read->type, kSenderDescription);
  EXPECT_EQ(read->time_us, 1'795'726'304'751'556);
  EXPECT_EQ(read_name(read->payload), "Tracker0");
  EXPECT_FALSE(parser.next());
  EXPECT_FALSE(parser.is_broken());
}

TEST(Messages, OfAnImpossibleLengthBreakTheStream) {
  for (const char* length : {"00000017", "ffffffff", "00004019"}) {
    Parser parser;
    parser.push(bytes_of(std::string(length) + std::string(40, '0')));
    EXPECT_FALSE(parser.next());
    EXPECT_TRUE(parser.is_broken()) << length;
  }
}

TEST(Payloads, OfPosesAreReadAndWritten) {
  auto bytes = bytes_of(kPose);
  const auto read = read_pose(bytes);
  ASSERT_TRUE(read);
  EXPECT_EQ(read->sensor, 1);
  EXPECT_EQ(read->pose.orientation, driver::Quaternion{});
  const driver::Pose pose{.position_m = {1, -2, 0.5}, .orientation = {0.5, -0.5, 0.5, 0.5}};
  const auto again = read_pose(pose_payload(7, pose));
  ASSERT_TRUE(again);
  EXPECT_EQ(again->sensor, 7);
  EXPECT_EQ(again->pose.position_m, pose.position_m);
  EXPECT_EQ(again->pose.orientation, pose.orientation);
  driver::Pose wrong;
  wrong.position_m.y = std::numeric_limits<double>::infinity();
  EXPECT_FALSE(read_pose(pose_payload(0, wrong)));
  bytes.pop_back();
  EXPECT_FALSE(read_pose(bytes));
}

TEST(Payloads, HaveTheirDocumentedSizes) {
  EXPECT_EQ(button_payload(2, false), bytes_of("0000000200000000"));
  EXPECT_EQ(velocity_payload(0, {}, 1).size(), 72u);
  EXPECT_EQ(force_payload({0, 0, 1}), bytes_of(std::string(32, '0') + "3ff0000000000000"));
  const std::array channels{1.0F, 0.0F};
  EXPECT_EQ(analog_payload(channels),
            bytes_of("40000000000000003ff0000000000000" + std::string(16, '0')));
}

TEST(Payloads, OfNamesAreCheckedForTheirLength) {
  EXPECT_EQ(read_name(bytes_of("00000002410042")), "A");
  EXPECT_FALSE(read_name(bytes_of("000000094100")));
  EXPECT_FALSE(read_name(bytes_of("0000")));
}

}  // namespace
}  // namespace rtpm::vrpn
