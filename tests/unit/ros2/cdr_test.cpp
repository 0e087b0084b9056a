#include "rtpm/ros2/cdr.hpp"

#include <gtest/gtest.h>

#include <string>

#include "rtpm/ros2/message.hpp"

namespace rtpm::ros2 {
namespace {

std::vector<std::byte> encoded(const auto& message) {
  std::vector<std::byte> buffer;
  encode(message, buffer);
  return buffer;
}

TEST(Cdr, AlignsFromBehindTheEncapsulation) {
  std::vector<std::byte> buffer;
  CdrWriter writer(buffer);
  writer.put(std::uint8_t{1});
  writer.put(2.0);
  EXPECT_EQ(buffer.size(), 4u + 8 + 8);
  CdrReader reader(buffer);
  EXPECT_EQ(reader.take<std::uint8_t>(), 1);
  EXPECT_EQ(reader.take<double>(), 2.0);
  reader.end();
  EXPECT_TRUE(reader.ok());
}

TEST(Cdr, RefusesOtherEncapsulations) {
  auto bytes = encoded(Bool{true});
  bytes[1] = std::byte{0};  // Big-endian.
  EXPECT_EQ(decode<Bool>(bytes).error(), "it is not plain little-endian CDR");
  bytes[1] = std::byte{7};  // XCDR2.
  EXPECT_FALSE(decode<Bool>(bytes));
  EXPECT_FALSE(decode<Bool>({}));
}

TEST(Cdr, RefusesTruthValuesBesides0And1) {
  auto bytes = encoded(Bool{true});
  bytes[4] = std::byte{2};
  EXPECT_EQ(decode<Bool>(bytes).error(), "a truth value is neither 0 nor 1");
}

TEST(Cdr, RefusesTextsWithoutEnd) {
  auto bytes = encoded(String{"ab"});
  bytes.back() = std::byte{'c'};
  EXPECT_EQ(decode<String>(bytes).error(), "a text has no end");
}

TEST(Cdr, ReadsAnEmptyTextWithoutItsNul) {
  const std::vector<std::byte> bytes{std::byte{0}, std::byte{1}, std::byte{0}, std::byte{0},
                                     std::byte{0}, std::byte{0}, std::byte{0}, std::byte{0}};
  EXPECT_EQ(decode<String>(bytes)->data, "");
}

TEST(Cdr, LeavesOutWhatFollowsANul) {
  const auto text = decode<String>(encoded(String{std::string("a\0b", 3)}));
  EXPECT_EQ(text->data, "a");
}

TEST(Cdr, RefusesASequenceThatItsBytesCantHold) {
  std::vector<std::byte> buffer;
  CdrWriter writer(buffer);
  writer.put(std::uint32_t{0xffffffff});
  EXPECT_EQ(decode<TfMessage>(buffer).error(), "it is shorter than its type");
}

TEST(Cdr, RefusesABoundedTextThatIsTooLong) {
  ParticipantEntitiesInfo info;
  info.node_entities_info_seq.resize(1);
  info.node_entities_info_seq[0].node_name.text = std::string(256, 'n');
  auto bytes = encoded(info);
  EXPECT_TRUE(decode<ParticipantEntitiesInfo>(bytes));
  std::vector<std::byte> buffer;
  CdrWriter writer(buffer);
  writer.put_bytes(std::as_bytes(std::span(info.gid.data)));
  writer.put(std::uint32_t{1});
  writer.put_text(std::string(257, 'n'));
  writer.put_text("");
  writer.put(std::uint32_t{0});
  writer.put(std::uint32_t{0});
  EXPECT_EQ(decode<ParticipantEntitiesInfo>(buffer).error(), "a bounded text is too long");
}

TEST(Definition, HasTheMessagesThatItContains) {
  const std::string line(80, '=');
  EXPECT_EQ(definition<PoseStamped>(),
            "std_msgs/Header header\ngeometry_msgs/Pose pose\n" + line +
                "\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n" + line +
                "\nMSG: geometry_msgs/Point\nfloat64 x\nfloat64 y\nfloat64 z\n" + line +
                "\nMSG: geometry_msgs/Pose\ngeometry_msgs/Point position\n"
                "geometry_msgs/Quaternion orientation\n" +
                line + "\nMSG: geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\n" +
                "float64 w\n" + line +
                "\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n");
  EXPECT_EQ(definition<Empty>(), "");
  EXPECT_NE(definition<Imu>().find("float64[9] orientation_covariance\n"), std::string::npos);
  EXPECT_NE(definition<ParticipantEntitiesInfo>().find("string<=256 node_name\n"),
            std::string::npos);
}

}  // namespace
}  // namespace rtpm::ros2
