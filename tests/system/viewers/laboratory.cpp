#include "laboratory.hpp"

#include <unistd.h>

#include <array>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "rtpm/test/npm_peer.hpp"
#include "rtpm/viewers/messages.hpp"

namespace rtpm::system_test {
namespace {

using Vector = std::array<double, 3>;

Vector vector_of(const Json& value) {
  return {value["x"].get<double>(), value["y"].get<double>(), value["z"].get<double>()};
}

/// Samples by the time of their message, and by their sequence.
std::map<std::uint64_t, Json> samples_of(const Json& channel) {
  std::map<std::uint64_t, Json> samples;
  for (const Json& message : channel["messages"]) {
    const Json& sample = message["value"]["sample"];
    samples[whole(message.contains("publish_time_ns") ? message["publish_time_ns"]
                                                      : message["log_time_ns"])] = sample;
  }
  return samples;
}

/// "arm0/base" of "lab/arm0".
std::string frame_of(const std::string& device) {
  return device.substr(device.find('/') + 1) + "/base";
}

std::uint64_t stamp_of(const Json& time) {
  return time["sec"].get<std::uint64_t>() * 1'000'000'000 + time["nsec"].get<std::uint64_t>();
}

void expect_pose(const Json& position, const Json& orientation, const Json& sample) {
  EXPECT_EQ(vector_of(position), vector_of(sample["position_m"]));
  EXPECT_EQ(vector_of(orientation), vector_of(sample["orientation"]));
  EXPECT_EQ(orientation["w"], sample["orientation"]["w"]);
}

/// The direction to which a rotation turns +x, where an arrow points without it.
Vector direction_of(const Json& turn) {
  const auto [x, y, z] = vector_of(turn);
  const double w = turn["w"];
  return {1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)};
}

/// @return whether there is an arrow
bool expect_arrow(const Json& scene, const Json& sample) {
  const Vector force = vector_of(sample["force_newton"]);
  const double newton = std::hypot(force[0], force[1], force[2]);
  const Json& arrows = scene["entities"][0]["arrows"];
  EXPECT_EQ(arrows.size(), newton > 0 ? 1u : 0u) << newton;
  if (arrows.empty()) return false;
  const Json& arrow = arrows[0];
  EXPECT_NEAR(arrow["shaft_length"].get<double>() + arrow["head_length"].get<double>(),
              newton * viewers::kArrowMetrePerNewton, 1e-9);
  EXPECT_EQ(vector_of(arrow["pose"]["position"]), vector_of(sample["position_m"]));
  const Vector direction = direction_of(arrow["pose"]["orientation"]);
  for (std::size_t i = 0; i < 3; ++i)
    EXPECT_NEAR(direction[i], force[i] / newton, 1e-9);
  return true;
}

}  // namespace

std::string lichtblick_folder() {
  const char* const folder = std::getenv("RTPM_LICHTBLICK");
  return folder == nullptr ? "" : folder;
}

void ViewedLaboratory::SetUp() {
  if (!test::install_peer())
    GTEST_SKIP() << "npm is not installed, or can't install flatbuffers_reflection";
  folder_ = testing::TempDir() + "rtpm_viewers_" + std::to_string(::getpid());
  std::filesystem::create_directories(folder_ + "/page");
  registry_ = start_daemon("rtpm-registryd", {"--port", "0", "--realtime", "off"});
  ASSERT_TRUE(registry_);
  devices_ = start_daemon(
      "rtpm-deviced",
      {"--port", "0", "--registry", registry_->url, "--realtime", "off", "--serve-events",
       "--devices", "arm0,gaze0,biometric0,knob0", "--device-gaze0-driver", "gaze",
       "--device-biometric0-driver", "biometric", "--device-knob0-driver", "knob"});
  ASSERT_TRUE(devices_);
  servo_.emplace(std::vector<std::string>{path_of("rtpm-servo"), "--registry", registry_->url,
                                          "--seconds", "0", "--realtime", "off", "--events",
                                          "rtpm/events", "--render", "local"});
}

void ViewedLaboratory::TearDown() {
  console_.reset();
  servo_.reset();
  if (!folder_.empty()) std::filesystem::remove_all(folder_);
}

std::string ViewedLaboratory::record(int seconds) {
  const std::string file = folder_ + "/run.mcap";
  test::Process recorder({path_of("rtpm"), "record", file, "--for", std::to_string(seconds) + "s",
                          "--registry", registry_->url});
  EXPECT_FALSE(recorder.wait(std::chrono::milliseconds{750 * seconds})) << recorder.errors();
  servo_->send_signal(SIGINT);
  const auto end = recorder.wait(kPatience);
  const bool is_recorded = end && end->exit_code == 0;
  EXPECT_TRUE(is_recorded) << recorder.errors();
  return is_recorded ? file : "";
}

std::string ViewedLaboratory::start_console() {
  console_.emplace(std::vector<std::string>{path_of("rtpm-console"), "--port", "0", "--registry",
                                            registry_->url, "--page", folder_ + "/page",
                                            "--incidents", "none"});
  if (!console_->wait_for_output("http://", kPatience) ||
      !console_->wait_for_output("\n", kPatience)) {
    ADD_FAILURE() << "rtpm-console does not serve: " << console_->output() << console_->errors();
    return "";
  }
  const std::string output = console_->output();
  const std::size_t begin = output.find("://") + 3;
  return "ws://" + output.substr(begin, output.find_first_of("/ \n", begin) - begin);
}

ViewedLaboratory::Channels ViewedLaboratory::view(const std::string& words) {
  Channels channels;
  const Json list = test::run_peer(words);
  EXPECT_TRUE(list.is_array()) << list;
  if (!list.is_array()) return channels;
  for (const Json& channel : list)
    channels[channel["topic"]] = channel;
  return channels;
}

std::uint64_t whole(const Json& number) {
  return number.is_string() ? std::stoull(number.get<std::string>()) : number.get<std::uint64_t>();
}

void expect_opened(const std::map<std::string, Json>& channels) {
  for (const auto& [topic, channel] : channels) {
    EXPECT_FALSE(channel.contains("refusal")) << topic << ": " << channel["refusal"];
  }
}

void expect_drawn_as_sampled(const std::map<std::string, Json>& channels,
                             const std::string& sample_leaf) {
  std::map<std::string, std::map<std::uint64_t, Json>> samples;
  for (const std::string device : kDevices) {
    ASSERT_TRUE(channels.contains(device + sample_leaf)) << device;
    samples[device] = samples_of(channels.at(device + sample_leaf));
    EXPECT_GT(samples[device].size(), 10u) << device;
  }
  std::size_t pose_count = 0;
  std::size_t transform_count = 0;
  std::size_t arrow_count = 0;
  for (const std::string device : {"lab/arm0", "lab/gaze0"}) {
    for (const Json& message : channels.at(device + "/pose")["messages"]) {
      const Json& value = message["value"];
      const auto sample = samples[device].find(stamp_of(value["timestamp"]));
      if (sample == samples[device].end()) continue;
      EXPECT_EQ(value["frame_id"], frame_of(device));
      expect_pose(value["pose"]["position"], value["pose"]["orientation"], sample->second);
      ++pose_count;
    }
  }
  for (const Json& message : channels.at("rtpm/tf")["messages"]) {
    for (const Json& transform : message["value"]["transforms"]) {
      const std::string device = transform["child_frame_id"];
      const auto sample = samples[device].find(stamp_of(transform["timestamp"]));
      if (sample == samples[device].end()) continue;
      EXPECT_EQ(transform["parent_frame_id"], frame_of(device));
      expect_pose(transform["translation"], transform["rotation"], sample->second);
      ++transform_count;
    }
  }
  for (const Json& message : channels.at("lab/arm0/force")["messages"]) {
    const Json& scene = message["value"];
    const auto sample = samples["lab/arm0"].find(stamp_of(scene["entities"][0]["timestamp"]));
    if (sample == samples["lab/arm0"].end()) continue;
    if (expect_arrow(scene, sample->second)) ++arrow_count;
  }
  EXPECT_GT(pose_count, 10u);
  EXPECT_GT(transform_count, 10u);
  EXPECT_GT(arrow_count, 0u);
}

void expect_wall_until_end(const std::map<std::string, Json>& channels) {
  std::string walls;  // One character for each change.
  for (const Json& message : channels.at("lab/arm0/force")["messages"]) {
    const Json& models = message["value"]["entities"][1];
    EXPECT_EQ(models["id"], "lab/arm0/models");
    const char wall = models["cubes"].size() == 1 ? 'w' : '-';
    if (walls.empty() || walls.back() != wall) walls += wall;
  }
  // The recorder may know the device before it hears of its models.
  EXPECT_TRUE(walls == "w-" || walls == "-w-") << walls;
  const Json& lists = channels.at("lab/arm0/models_rendered")["messages"];
  ASSERT_GE(lists.size(), 2u);
  EXPECT_EQ(lists.front()["value"]["models"].size(), 1u);
  EXPECT_TRUE(lists.back()["value"]["models"].empty());
}

namespace {

/// All message paths and topics in the panels' settings.
void collect_paths(const Json& value, std::vector<std::string>& paths) {
  if (!value.is_structured()) return;
  for (const auto& [key, one] : value.items()) {
    const bool is_path = one.is_string() && (key == "value" || key == "topicPath");
    if (is_path) paths.push_back(one.get<std::string>());
    if (key == "topics") {
      for (const auto& [topic, settings] : one.items())
        paths.push_back(topic);
    }
    collect_paths(one, paths);
  }
}

/// Whether the newest message has the fields "sample.position_m.x".
bool has_field(const Json& channel, const std::string& fields) {
  if (channel["messages"].empty()) return false;
  Json value = channel["messages"].back()["value"];
  std::istringstream stream(fields);
  for (std::string name; std::getline(stream, name, '.');) {
    if (!value.contains(name)) return false;
    value = Json(value[name]);
  }
  return !fields.empty() ? value.is_number() : true;
}

}  // namespace

void expect_laid_out(const std::map<std::string, Json>& channels, const std::string& sample_leaf) {
  std::ifstream stream(RTPM_LAYOUT);
  std::vector<std::string> paths;
  collect_paths(Json::parse(stream), paths);
  std::size_t count = 0;
  for (const std::string& path : paths) {
    const std::size_t dot = std::min(path.find('.'), path.size());
    const std::string topic = path.substr(0, dot);
    const bool is_live = !topic.ends_with("/sampled") && !topic.ends_with("_changed");
    const bool is_recorded = !topic.ends_with("/sample");
    if (sample_leaf == "/sample" ? !is_live : !is_recorded) continue;
    ASSERT_TRUE(channels.contains(topic)) << path;
    EXPECT_TRUE(has_field(channels.at(topic), path.substr(std::min(dot + 1, path.size())))) << path;
    ++count;
  }
  EXPECT_GE(count, 9u);
}

}  // namespace rtpm::system_test
