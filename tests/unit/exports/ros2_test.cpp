#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "example_recording.hpp"
#include "rtpm/exports/export.hpp"
#include "rtpm/ros2/message.hpp"

namespace rtpm::exports {
namespace {

class Ros2 : public testing::Test {
 protected:
  expected<Report, SetupError> exported(const Ros2Options& options = {}) {
    auto reader = recording::FileReader::open(file_);
    EXPECT_TRUE(reader) << reader.error().text();
    auto report = export_ros2(**reader, out_, options);
    if (report) result_ = *recording::FileReader::open(out_);
    return report;
  }
  /// The messages of a topic, decoded.
  template <ros2::Message M>
  [[nodiscard]] std::vector<M> messages(const std::string& topic) {
    std::vector<M> list;
    const auto read = result_->read({}, [&](const recording::Message& message) {
      if (result_->channels().at(message.channel_id).topic != topic) return true;
      const auto decoded = ros2::decode<M>(message.data);
      EXPECT_TRUE(decoded);
      if (decoded) list.push_back(*decoded);
      return true;
    });
    EXPECT_TRUE(read);
    return list;
  }
  [[nodiscard]] std::set<std::string> topics() const {
    std::set<std::string> names;
    for (const auto& [number, channel] : result_->channels())
      names.insert(channel.topic);
    return names;
  }

  recording::Folder folder_;
  std::string file_ = folder_.fresh("run");
  std::string out_ = folder_.fresh("ros2");
  std::unique_ptr<recording::FileReader> result_;
};

TEST_F(Ros2, HasADevicesMessages) {
  test::Example example(file_);
  example.put_arm(3);
  example.end();
  const auto report = exported();
  ASSERT_TRUE(report) << report.error().text();
  EXPECT_TRUE(report->left_out.empty());
  EXPECT_EQ(topics(), (std::set<std::string>{"/diagnostics", "/rtpm/lab/arm_0/applied_wrench",
                                             "/rtpm/lab/arm_0/description",
                                             "/rtpm/lab/arm_0/joint_states", "/rtpm/lab/arm_0/joy",
                                             "/rtpm/lab/arm_0/pose", "/rtpm/lab/arm_0/twist"}));
  const auto poses = messages<ros2::PoseStamped>("/rtpm/lab/arm_0/pose");
  ASSERT_EQ(poses.size(), 3u);
  EXPECT_EQ(poses[2].header.frame_id, "arm/base");
  EXPECT_EQ(poses[2].header.stamp.sec, 1'700'000'000);
  EXPECT_EQ(poses[2].header.stamp.nanosec, 3'000'000u);
  EXPECT_EQ(poses[2].pose.position.x, 0.2);
  EXPECT_EQ(messages<ros2::WrenchStamped>("/rtpm/lab/arm_0/applied_wrench")[0].wrench.force.z, 5);
  EXPECT_EQ(messages<ros2::Joy>("/rtpm/lab/arm_0/joy")[0].axes, std::vector<float>{0.5f});
  // The status did not change within the second.
  EXPECT_EQ(messages<ros2::DiagnosticArray>("/diagnostics").size(), 1u);
}

TEST_F(Ros2, CanBeOfAPartThatBeginsWithTheDescription) {
  test::Example example(file_);
  example.put_arm(20);
  example.end();
  const auto at = [](std::uint64_t ms) { return test::kBeginNs + ms * 1'000'000; };
  const Ros2Options options{
      .part = {.to_s = 0.015, .between = {{"slipped", "again"}}},
      .notes = {{.time_ns = at(10), .text = "slipped"}, {.time_ns = at(17), .text = "again"}}};
  const auto report = exported(options);
  ASSERT_TRUE(report) << report.error().text();
  EXPECT_EQ(result_->statistics().begin_ns, at(10));
  EXPECT_EQ(result_->statistics().end_ns, at(14));
  EXPECT_EQ(messages<ros2::PoseStamped>("/rtpm/lab/arm_0/pose").size(), 5u);
  EXPECT_EQ(messages<ros2::String>("/rtpm/lab/arm_0/description").size(), 1u);
  EXPECT_EQ(messages<ros2::DiagnosticArray>("/diagnostics").size(), 1u);
  EXPECT_EQ(report->message_count, 6u);
}

TEST_F(Ros2, HasChannelsAsRosbag2WritesThem) {
  test::Example example(file_);
  example.put_arm(1);
  example.end();
  ASSERT_TRUE(exported());
  for (const auto& [number, channel] : result_->channels()) {
    EXPECT_EQ(channel.message_encoding, "cdr");
    EXPECT_EQ(result_->schemas().at(channel.schema_id).encoding, "ros2msg");
    EXPECT_EQ(channel.metadata.at("topic_type_hash").rfind("RIHS01_", 0), 0u);
    const bool is_latched = channel.topic.ends_with("description");
    EXPECT_NE(channel.metadata.at("offered_qos_profiles")
                  .find(is_latched ? "  durability: 1\n" : "  durability: 2\n"),
              std::string::npos);
  }
}

TEST_F(Ros2, HasOtherEventsAsJson) {
  test::Example example(file_);
  example.put_trials({R"({"number":1,"response":"yes","force":0.1,"picture":[1],"late":2})"});
  example.put(example.add({.topic = "annotations", .message_encoding = "json"}),
              recording::bytes_of(R"({"text":"x"})"));
  ASSERT_TRUE(example.writer().write(
      recording::Metadata{.name = "clocks", .values = {{"uncertainty_ns", "250"}}}));
  example.end();
  ASSERT_TRUE(exported());
  EXPECT_EQ(messages<ros2::String>("/rtpm/lab_Trial/_3").at(0).data,
            R"({"number":1,"phase":"Test","response":"yes","force":0.1,"picture":"AQ==","seed":0,)"
            R"("late":2})");
  EXPECT_EQ(messages<ros2::String>("/rtpm/annotations").at(0).data, R"({"text":"x"})");
  EXPECT_EQ(result_->read_metadata()->at(0).values.at("uncertainty_ns"), "250");
}

TEST_F(Ros2, HasPicturesAsCompressedImages) {
  test::Example example(file_);
  std::string error;
  const auto dynamic = schema::Dynamic::make(R"(namespace foxglove;
    struct Time { sec:uint; nsec:uint; }
    table CompressedVideo { timestamp:Time; frame_id:string; data:[ubyte]; format:string; })",
                                             error);
  ASSERT_NE(dynamic, nullptr) << error;
  const auto& objects = dynamic->model().objects;
  const auto table = std::ranges::find(objects, "foxglove.CompressedVideo", &schema::Object::name);
  ASSERT_NE(table, objects.end());
  const schema::Payload payload{.kind = schema::PayloadKind::kTable,
                                .table = static_cast<std::size_t>(table - objects.begin())};
  const auto frame =
      dynamic->encode(payload, R"({"frame_id":"cam","data":[0,0,1,200],"format":"h264"})", error);
  ASSERT_TRUE(frame) << error;
  const std::uint16_t video =
      example.add(*dynamic, "foxglove.CompressedVideo", "lab/cam0/video", {});
  example.put(video, *frame);
  example.put(video, recording::bytes_of("broken"));
  example.end();
  const auto report = exported();
  ASSERT_TRUE(report) << report.error().text();
  ASSERT_EQ(report->left_out.size(), 1u);
  EXPECT_EQ(report->left_out[0].message_count, 1u);
  const auto images = messages<ros2::CompressedImage>("/rtpm/lab/cam0/video");
  ASSERT_EQ(images.size(), 1u);
  EXPECT_EQ(images[0].header.frame_id, "cam");
  EXPECT_EQ(images[0].header.stamp.sec, 1'700'000'000);
  EXPECT_EQ(images[0].format, "h264");
  EXPECT_EQ(images[0].data, (std::vector<std::uint8_t>{0, 0, 1, 200}));
}

TEST_F(Ros2, LeavesOutATopicWithAnothersName) {
  test::Example example(file_);
  example.put_arm(1, "lab/arm-0");
  example.put_arm(1, "lab/arm.0");
  example.end();
  const auto report = exported();
  ASSERT_TRUE(report);
  ASSERT_EQ(report->left_out.size(), 2u);
  EXPECT_EQ(report->left_out[1].reason,
            "its name in ROS 2, '/rtpm/lab/arm_0/pose', is already that of lab/arm-0");
}

TEST_F(Ros2, HasSamplesWithoutADescriptionAsJson) {
  test::Example example(file_);
  const auto& event = device::SampledEvent::kDescriptor;
  std::string error;
  const auto dynamic =
      schema::Dynamic::make_for_event(std::string(event.schema), event.name, error);
  const device::Sample wire = gvd::to_wire(test::arm_sample(1));
  flatbuffers::FlatBufferBuilder builder;
  builder.Finish(device::CreateSampled(builder, &wire));
  example.put(example.add(*dynamic, "rtpm.device.Sampled", "rtpm.device.Sampled/9", {}), builder);
  example.end();
  ASSERT_TRUE(exported());
  const auto texts = messages<ros2::String>("/rtpm/rtpm_device_Sampled/_9");
  ASSERT_EQ(texts.size(), 1u);
  EXPECT_EQ(texts[0].data.rfind(R"({"sample":{"sequence":1,)", 0), 0u) << texts[0].data;
}

}  // namespace
}  // namespace rtpm::exports
