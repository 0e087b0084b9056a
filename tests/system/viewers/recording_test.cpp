#include <cstdlib>
#include <cstring>
#include <device_events.rtpm.events.hpp>
#include <fstream>
#include <iterator>
#include <set>
#include <utility>

#include "laboratory.hpp"
#include "rtpm/recording/file_reader.hpp"

// A recording of the simulated laboratory, as Foxglove and Lichtblick read it.
namespace rtpm::system_test {
namespace {

/// Long enough for the buttons of tracker and knob, which their twins press every 4 and 3 s.
constexpr int kSeconds = 5;

/// The struct at the end of a table whose only field it is.
device::Sample sample_in(ConstBytes table) {
  const std::vector<std::byte> aligned(table.begin(), table.end());
  return *flatbuffers::GetRoot<device::Sampled>(aligned.data())->sample();
}

template <class Values>
void expect_elements(const Json& sample, const std::string& name, const Values& values) {
  for (std::uint16_t i = 0; i < values->size(); ++i)
    EXPECT_EQ(sample[name + "_" + std::to_string(i)], values->Get(i)) << name << i;
}

/// Whether a viewer's values are those of the recorded bytes, each array element by its own name.
void expect_same(const Json& seen, const device::Sample& sample) {
  EXPECT_EQ(whole(seen["sequence"]), sample.sequence());
  EXPECT_EQ(whole(seen["host_time_ns"]), static_cast<std::uint64_t>(sample.host_time_ns()));
  EXPECT_EQ(seen["position_m"]["y"], sample.position_m().y());
  EXPECT_EQ(seen["torque_newton_metre"]["z"], sample.torque_newton_metre().z());
  expect_elements(seen, "joints", sample.joints());
  expect_elements(seen, "joint_velocities", sample.joint_velocities());
  expect_elements(seen, "efforts", sample.efforts());
  expect_elements(seen, "outputs", sample.outputs());
  expect_elements(seen, "analogs", sample.analogs());
  expect_elements(seen, "button_edges", sample.button_edges());
  EXPECT_EQ(seen["buttons"], sample.buttons());
  EXPECT_EQ(seen["success_rate"], sample.success_rate());
  EXPECT_EQ(seen["lifecycle"], sample.lifecycle());
}

/// Compares all samples in the file with a viewer's.
void expect_samples(const std::string& file, const std::map<std::string, Json>& channels) {
  const auto reader = recording::FileReader::open(file);
  ASSERT_TRUE(reader) << reader.error().text();
  std::map<std::string, std::size_t> counts;
  const auto read = (*reader)->read({}, [&](const recording::Message& message) {
    const std::string& topic = (*reader)->channels().at(message.channel_id).topic;
    if (!topic.ends_with("/sampled")) return true;
    const Json& seen = channels.at(topic)["messages"][counts[topic]++];
    expect_same(seen["value"]["sample"], sample_in(message.data));
    return !testing::Test::HasFailure();
  });
  EXPECT_TRUE(read) << read.error().text();
  EXPECT_GT(counts["lab/arm0/sampled"], 100u);
}

/// Whether Lichtblick's 3D panel draws messages of this schema.
/// @source  lichtblick packages/suite-base/src/panels/ThreeDeeRender/foxglove.ts
bool is_drawn(const std::string& schema) {
  static const std::set<std::string> kDrawn{"foxglove.PoseInFrame", "foxglove.FrameTransforms",
                                            "foxglove.SceneUpdate"};
  return kDrawn.contains(schema);
}

/// The row of a channel in the table: its topic and its schema.
std::pair<std::string, std::string> row_of(const std::string& topic, const std::string& schema) {
  for (const std::string device : kDevices) {
    if (!topic.starts_with(device + "/")) continue;
    if (topic.ends_with("_changed")) return {"NAME/…_changed", "`rtpm.device.…Changed`"};
    return {"NAME" + topic.substr(device.size()), "`" + schema + "`"};
  }
  if (topic.starts_with(schema + "/")) return {"TYPE/SOURCE", "the event's type"};
  return {topic, "`" + schema + "`"};
}

std::string table_of(const std::map<std::string, Json>& channels) {
  std::map<std::string, std::string> rows;
  for (const auto& [topic, channel] : channels) {
    const auto [name, schema] = row_of(topic, channel["schema"]);
    const bool is_open = !channel.contains("refusal") && !channel["messages"].empty();
    rows[name] = "| `" + name + "` | " + schema + " | " + (is_open ? "yes" : "no") + " | " +
                 (is_open && is_drawn(channel["schema"]) ? "yes" : "") + " |\n";
  }
  std::string table =
      "| Channel | Schema | Values and plots in Foxglove and Lichtblick | In their 3D panel |\n"
      "|---|---|---|---|\n";
  for (const auto& [name, row] : rows)
    table += row;
  return table;
}

std::string text_of(const std::string& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

/// Compares the table in the README with `table`, or writes it there if RTPM_UPDATE_GOLDENS is set.
void expect_in_readme(const std::string& table) {
  const std::string begin_mark = "<!-- made by tests/system/viewers -->\n";
  const std::string end_mark = "<!-- until here -->";
  const std::string text = text_of(RTPM_RECORDINGS_README);
  const std::size_t begin = text.find(begin_mark);
  const std::size_t end = text.find(end_mark);
  ASSERT_NE(begin, std::string::npos);
  ASSERT_NE(end, std::string::npos);
  const std::size_t first = begin + begin_mark.size();
  if (std::getenv("RTPM_UPDATE_GOLDENS") != nullptr) {
    std::ofstream(RTPM_RECORDINGS_README, std::ios::binary)
        << text.substr(0, first) + table + text.substr(end);
    return;
  }
  EXPECT_EQ(text.substr(first, end - first), table)
      << "If the change is intended, run this test with RTPM_UPDATE_GOLDENS=1";
}

class ViewedRecording : public ViewedLaboratory {};

TEST_F(ViewedRecording, OpensInFlatbuffersReflection) {
  const std::string file = record(kSeconds);
  ASSERT_FALSE(file.empty());
  const Channels channels = view("file.mjs '" + file + "'");
  expect_opened(channels);
  expect_drawn_as_sampled(channels, "/sampled");
  expect_wall_until_end(channels);
  expect_samples(file, channels);
  for (const char* const topic : {"lab/arm0/description", "lab/gaze0/button_changed",
                                  "lab/knob0/button_changed", "lab/arm0/contact_changed"}) {
    ASSERT_TRUE(channels.contains(topic)) << topic;
    EXPECT_FALSE(channels.at(topic)["messages"].empty()) << topic;
  }
  EXPECT_EQ(channels.at("lab/arm0/description")["messages"][0]["value"]["serial"], "sim-arm0");
  // A scene at most 30 times a second, a pose 100 times.
  EXPECT_LE(channels.at("lab/arm0/force")["messages"].size(), 31u * kSeconds);
  EXPECT_LE(channels.at("lab/arm0/pose")["messages"].size(), 101u * kSeconds);
  expect_laid_out(channels, "/sampled");
  expect_in_readme(table_of(channels));
}

TEST_F(ViewedRecording, OpensInLichtblick) {
  if (lichtblick_folder().empty()) GTEST_SKIP() << "RTPM_LICHTBLICK names no sources of Lichtblick";
  const std::string file = record(1);
  ASSERT_FALSE(file.empty());
  const Channels channels = view("file.mjs '" + file + "' '" + lichtblick_folder() + "'");
  expect_opened(channels);
  expect_drawn_as_sampled(channels, "/sampled");
  expect_samples(file, channels);
}

}  // namespace
}  // namespace rtpm::system_test
