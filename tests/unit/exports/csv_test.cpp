#include <gtest/gtest.h>

#include <filesystem>

#include "example_recording.hpp"
#include "rtpm/exports/export.hpp"

namespace rtpm::exports {
namespace {

class Csv : public testing::Test {
 protected:
  expected<Report, SetupError> exported() {
    auto reader = recording::FileReader::open(file_);
    EXPECT_TRUE(reader) << reader.error().text();
    return export_csv(**reader, out_);
  }
  [[nodiscard]] std::string file(const std::string& name) const {
    return recording::content_of(out_ + "/" + name);
  }

  recording::Folder folder_;
  std::string file_ = folder_.fresh("run");
  std::string out_ = folder_.fresh("tables");
};

TEST_F(Csv, NamesASamplesColumnsByTheDevicesParts) {
  test::Example example(file_);
  example.put_arm(2);
  example.end();
  const auto report = exported();
  ASSERT_TRUE(report) << report.error().text();
  EXPECT_EQ(report->message_count, 3u);
  EXPECT_EQ(report->topic_count, 2u);
  EXPECT_TRUE(report->left_out.empty());
  EXPECT_EQ(file("lab_arm-0_sampled.csv"),
            "time [UTC],seconds [s],message,sequence,host_time_ns,device_time_ns,position_m.x,"
            "position_m.y,position_m.z,orientation.x,orientation.y,orientation.z,orientation.w,"
            "linear_m_per_s.x,linear_m_per_s.y,linear_m_per_s.z,angular_rad_per_s.x,"
            "angular_rad_per_s.y,angular_rad_per_s.z,force_newton.x,force_newton.y,force_newton.z,"
            "torque_newton_metre.x,torque_newton_metre.y,torque_newton_metre.z,joints.elbow [rad],"
            "joint_velocities.elbow [rad/s],efforts.elbow [N m],analogs.grip [N],buttons,faults,"
            "button_edges.stylus,success_rate,lifecycle\r\n"
            "2023-11-14T22:13:20.001000000Z,0.001000000,2,0,0,0,0,0.3333333333333333,-2,0,0,0,1,"
            "0,0,0,0,0,0,0,0,5,0,0,0,0.5,0,0,7.5,1,0,0,0,2\r\n"
            "2023-11-14T22:13:20.002000000Z,0.002000000,3,1,0,0,0.1,0.3333333333333333,-2,0,0,0,1,"
            "0,0,0,0,0,0,1e-07,0,5,0,0,0,0.5,0,0,7.5,1,0,0,0,2\r\n");
}

TEST_F(Csv, HasEveryKindOfField) {
  test::Example example(file_);
  example.put_trials(
      {R"({"number":1,"phase":"Training","response":"a \"b\",c","force":0.1,)"
       R"("pair":{"first":0.3,"numbers":[-1,2]},"note":{"text":"=2+3"},"samples":[1.5,2],)"
       R"("picture":[1,2,3,4],"seed":18446744073709551615,"late":-7})",
       "{}"});
  example.end();
  ASSERT_TRUE(exported());
  EXPECT_EQ(file("lab.Trial_3.csv"),
            "time [UTC],seconds [s],message,number,phase,response,force [N],pair.first,"
            "pair.numbers[0],pair.numbers[1],note.text,samples,picture,seed,late\r\n"
            "2023-11-14T22:13:20.000000000Z,0.000000000,1,1,Training,\"a \"\"b\"\",c\",0.1,0.3,-1,"
            "2,\"'=2+3\",\"[1.5,2]\",\"\"\"AQIDBA==\"\"\",18446744073709551615,-7\r\n"
            "2023-11-14T22:13:20.001000000Z,0.001000000,2,0,Test,,0,,,,,,,0,\r\n");
}

TEST_F(Csv, HasTheRecordingsMetadata) {
  test::Example example(file_);
  const std::uint16_t notes = example.add({.topic = "../a \"b\"", .message_encoding = "json"});
  example.put(notes, recording::bytes_of("{\"text\":\"x\"}"));
  ASSERT_TRUE(example.writer().write(
      recording::Metadata{.name = "clocks", .values = {{"uncertainty_ns", "250"}}}));
  example.end();
  ASSERT_TRUE(exported());
  EXPECT_EQ(file("_.._a__b_.csv"),
            "time [UTC],seconds [s],message,json\r\n"
            "2023-11-14T22:13:20.000000000Z,0.000000000,1,\"{\"\"text\"\":\"\"x\"\"}\"\r\n");
  EXPECT_EQ(file("recording.json"),
            "{\"begin\":\"2023-11-14T22:13:20.000000000Z\","
            "\"end\":\"2023-11-14T22:13:20.000000000Z\",\"channels\":[\n"
            "{\"file\":\"_.._a__b_.csv\",\"topic\":\"../a \\\"b\\\"\",\"type\":\"\","
            "\"message_count\":\"1\",\"values\":{}}],\"metadata\":[\n"
            "{\"name\":\"clocks\",\"values\":{\"uncertainty_ns\":\"250\"}}]}\n");
}

TEST_F(Csv, NamesAndCountsWhatItLeavesOut) {
  test::Example example(file_);
  example.put_trials({"{}"});
  const std::uint16_t trials = 1;
  example.put(trials, recording::bytes_of("broken"));
  const std::uint16_t other = example.add({.topic = "lab/other", .message_encoding = "protobuf"});
  example.put(other, recording::bytes_of("x"));
  recording::write_messages(example.writer(), 4);
  example.end();
  const auto report = exported();
  ASSERT_TRUE(report) << report.error().text();
  ASSERT_EQ(report->left_out.size(), 3u);
  EXPECT_EQ(report->left_out[0].topic, "lab.Trial/3");
  EXPECT_EQ(report->left_out[0].reason, "they do not match its schema");
  EXPECT_EQ(report->left_out[0].message_count, 1u);
  EXPECT_EQ(report->left_out[1].reason, "its encoding 'protobuf' is unknown");
  EXPECT_EQ(report->left_out[2].topic, "lab/touched");
  EXPECT_EQ(report->left_out[2].reason.rfind("its schema can't be read", 0), 0u);
  EXPECT_EQ(report->left_out[2].message_count, 2u);
}

TEST_F(Csv, KeepsAnExistingFolder) {
  test::Example example(file_);
  example.end();
  std::filesystem::create_directory(out_);
  const auto report = exported();
  ASSERT_FALSE(report);
  EXPECT_NE(report.error().text().find("exists already"), std::string::npos);
  EXPECT_TRUE(std::filesystem::is_empty(out_));
}

TEST_F(Csv, LeavesNothingWhenItIsStopped) {
  test::Example example(file_);
  example.put_arm(300);
  example.end();
  auto reader = recording::FileReader::open(file_);
  ASSERT_TRUE(reader);
  EXPECT_FALSE(export_csv(**reader, out_, {}, [](auto, auto) { return false; }));
  EXPECT_FALSE(std::filesystem::exists(out_));
  EXPECT_FALSE(std::filesystem::exists(out_ + ".part"));
}

}  // namespace
}  // namespace rtpm::exports
