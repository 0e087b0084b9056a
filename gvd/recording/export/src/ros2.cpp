#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "course.hpp"
#include "left_out.hpp"
#include "read_all.hpp"
#include "recorded_devices.hpp"
#include "ros2_topics.hpp"
#include "rows.hpp"
#include "rtpm/capture/channels.hpp"
#include "rtpm/exports/export.hpp"
#include "rtpm/ros2/device_messages.hpp"
#include "rtpm/ros2/names.hpp"

namespace rtpm::exports {
namespace {

/// Tools of ROS take a device for lost that reports less often.
constexpr std::uint64_t kDiagnosticsPeriodNs = 1'000'000'000;
constexpr const char* kDiagnosticsTopic = "/diagnostics";

/// A channel with a device's samples, and the topics that they become.
struct Samples {
  std::string name{};
  const driver::Descriptor* device = nullptr;
  std::optional<std::uint16_t> pose{};
  std::optional<std::uint16_t> twist{};
  std::optional<std::uint16_t> wrench{};
  std::optional<std::uint16_t> joints{};
  std::optional<std::uint16_t> joy{};
  std::optional<std::uint16_t> imu{};
  std::uint16_t diagnostics = 0;
  std::uint64_t diagnosed_ns = 0;  ///< When the last status was written.
  driver::Faults faults{};
  driver::Lifecycle lifecycle = driver::Lifecycle::kUnconfigured;
};

/// Any other channel: JSON in a text, or pictures.
struct Texts {
  std::uint16_t topic = 0;
  std::unique_ptr<Rows> rows{};  ///< nullptr: the messages are JSON.
  bool is_picture = false;
  bool is_state = false;  ///< Its last message holds until the next one.
};

/// The messages of Foxglove with a compressed picture.
bool is_picture(const std::string& type) {
  return type == "foxglove.CompressedVideo" || type == "foxglove.CompressedImage";
}

class Ros2Export {
 public:
  Ros2Export(recording::FileReader& reader, recording::FileWriter& writer,
             const Ros2Options& options, const recording::Progress& progress)
      : reader_(reader), writer_(writer), options_(options), topics_(writer), progress_(progress) {}

  expected<Report, SetupError> run() {
    auto devices = read_devices(reader_, progress_);
    if (!devices) return unexpected{devices.error()};
    devices_ = *std::move(devices);
    Course course(reader_, options_.notes);
    auto intervals = intervals_of(reader_, course, options_.part, progress_);
    if (!intervals) return unexpected{intervals.error()};
    intervals_ = *std::move(intervals);
    recording::Query query = query_of(intervals_);
    for (const auto& [number, channel] : reader_.channels()) {
      if (open(number, channel)) query.channel_ids.push_back(number);
    }
    if (auto written = write_states(); !written) return unexpected{written.error()};
    if (!query.channel_ids.empty()) {
      if (auto written = write_all(query); !written) return unexpected{written.error()};
    }
    if (auto copied = copy_extras(); !copied) return unexpected{copied.error()};
    return Report{.message_count = message_count_,
                  .topic_count = topics_.size(),
                  .left_out = left_out_.all()};
  }

 private:
  bool open(std::uint16_t number, const recording::Channel& channel) {
    if (is_view(channel)) return false;
    const auto device = devices_.find(capture::value_of(channel, capture::kDeviceKey));
    const bool is_sampled = device != devices_.end() && has_samples(reader_, channel);
    const auto refusal = is_sampled ? open_samples(number, device->first, device->second)
                                    : open_texts(number, channel);
    if (!refusal.empty()) left_out_.add(channel.topic, refusal, count_of(reader_, number));
    return refusal.empty();
  }

  /// Adds a topic below the device's name, if the device has it.
  template <ros2::Message M>
  void add_subject(bool has_it, std::string_view subject, const Samples& samples,
                   std::optional<std::uint16_t>& topic, std::string& refusal) {
    if (!has_it || !refusal.empty()) return;
    const auto added = topics_.add<M>(ros2::topic_name(samples.name, subject), samples.name,
                                      Durability::kVolatile);
    if (added) {
      topic = *added;
    } else {
      refusal = added.error();
    }
  }

  /// @return why the channel can't be converted, or nothing
  std::string open_samples(std::uint16_t number, const std::string& name,
                           const driver::Descriptor& device) {
    Samples samples{.name = name, .device = &device};
    const ros2::Subjects has = ros2::subjects_of(device);
    std::string refusal;
    add_subject<ros2::PoseStamped>(has.has_pose, ros2::kPoseTopic, samples, samples.pose, refusal);
    add_subject<ros2::TwistStamped>(has.has_pose, ros2::kTwistTopic, samples, samples.twist,
                                    refusal);
    add_subject<ros2::WrenchStamped>(has.has_wrench, ros2::kWrenchTopic, samples, samples.wrench,
                                     refusal);
    add_subject<ros2::JointState>(has.has_joints, ros2::kJointsTopic, samples, samples.joints,
                                  refusal);
    add_subject<ros2::Joy>(has.has_joy, ros2::kJoyTopic, samples, samples.joy, refusal);
    add_subject<ros2::Imu>(has.has_imu, ros2::kImuTopic, samples, samples.imu, refusal);
    const auto diagnostics = topics_.add<ros2::DiagnosticArray>(
        kDiagnosticsTopic, kDiagnosticsTopic, Durability::kVolatile);
    if (!diagnostics) return diagnostics.error();
    samples.diagnostics = *diagnostics;
    samples_.emplace(number, std::move(samples));
    return refusal;
  }

  std::string open_texts(std::uint16_t number, const recording::Channel& channel) {
    Texts texts;
    const auto schema = reader_.schemas().find(channel.schema_id);
    if (channel.message_encoding != "json") {
      if (schema == reader_.schemas().end() || channel.message_encoding != "flatbuffer")
        return "its encoding '" + channel.message_encoding + "' is unknown";
      auto rows = Rows::make(schema->second);
      if (!rows) return rows.error();
      texts.rows = std::move(*rows);
      texts.is_picture = is_picture(schema->second.name);
    }
    const std::string name = "/rtpm/" + ros2::ros_name(channel.topic);
    if (name.size() > ros2::kTopicSizeMax) return "its name is too long for ROS 2";
    texts.is_state = capture::value_of(channel, capture::kKindKey) == capture::kDescriptionKind;
    const Durability durability =
        texts.is_state ? Durability::kTransientLocal : Durability::kVolatile;
    const auto topic = texts.is_picture
                           ? topics_.add<ros2::CompressedImage>(name, channel.topic, durability)
                           : topics_.add<ros2::String>(name, channel.topic, durability);
    if (!topic) return topic.error();
    texts.topic = *topic;
    texts_.emplace(number, std::move(texts));
    return "";
  }

  expected<void, SetupError> write_all(const recording::Query& query) {
    return read_all(reader_, query, progress_, "the recording was not exported",
                    [this](const recording::Message& message) {
                      if (!is_inside(intervals_, time_of(message))) {
                        return expected<void, SetupError>{};
                      }
                      return convert(message);
                    });
  }

  /// Writes the last state before the part of each topic that has one, at the part's begin.
  expected<void, SetupError> write_states() {
    const std::uint64_t from_ns = intervals_.front().from_ns;
    recording::Query before{.to_ns = from_ns - std::min<std::uint64_t>(from_ns, 1)};
    for (const auto& [number, texts] : texts_) {
      if (texts.is_state) before.channel_ids.push_back(number);
    }
    if (from_ns <= reader_.statistics().begin_ns || before.channel_ids.empty()) return {};
    std::map<std::uint16_t, std::vector<std::byte>> last;
    const auto read = reader_.read(
        before,
        [&](const recording::Message& message) {
          if (time_of(message) < from_ns) {
            last[message.channel_id].assign(message.data.begin(), message.data.end());
          }
          return true;
        },
        progress_);
    if (!read) return read;
    for (const auto& [number, bytes] : last) {
      auto written = convert({.channel_id = number,
                              .log_time_ns = from_ns,
                              .publish_time_ns = from_ns,
                              .data = bytes});
      if (!written) return written;
    }
    return {};
  }

  expected<void, SetupError> convert(const recording::Message& message) {
    const auto samples = samples_.find(message.channel_id);
    const std::string& topic = reader_.channels().at(message.channel_id).topic;
    if (samples != samples_.end()) {
      const auto sample = sample_of(message);
      if (sample) return write_sample(samples->second, *sample, message);
      left_out_.add(topic, kBrokenMessage, 1);
      return {};
    }
    Texts& texts = texts_.at(message.channel_id);
    if (texts.is_picture) return write_picture(texts, topic, message);
    ros2::String text;
    if (texts.rows == nullptr) {
      text.data.assign(reinterpret_cast<const char*>(message.data.data()), message.data.size());
    } else if (!texts.rows->read_json(message.data, text.data)) {
      left_out_.add(topic, kBrokenMessage, 1);
      return {};
    }
    ++message_count_;
    return topics_.write(texts.topic, text, message);
  }

  expected<void, SetupError> write_picture(Texts& texts, const std::string& topic,
                                           const recording::Message& message) {
    const std::string data = texts.rows->read_bytes(message.data, "data");
    if (data.empty()) {
      left_out_.add(topic, kBrokenMessage, 1);
      return {};
    }
    const ros2::CompressedImage image{
        .header = {.stamp = ros2::time_of(static_cast<std::int64_t>(message.publish_time_ns)),
                   .frame_id = texts.rows->read_bytes(message.data, "frame_id")},
        .format = texts.rows->read_bytes(message.data, "format"),
        .data = {data.begin(), data.end()}};
    ++message_count_;
    return topics_.write(texts.topic, image, message);
  }

  expected<void, SetupError> write_sample(Samples& samples, const driver::Sample& sample,
                                          const recording::Message& message) {
    const driver::Descriptor& device = *samples.device;
    const ros2::Time stamp = ros2::time_of(static_cast<std::int64_t>(message.publish_time_ns));
    ++message_count_;
    expected<void, SetupError> done{};
    const auto write = [&](const std::optional<std::uint16_t>& topic, auto make) {
      if (topic && done) done = topics_.write(*topic, make(device, sample, stamp), message);
    };
    write(samples.pose, ros2::pose_of);
    write(samples.twist, ros2::twist_of);
    write(samples.wrench, ros2::applied_wrench_of);
    write(samples.joints, ros2::joint_state_of);
    write(samples.joy, ros2::joy_of);
    write(samples.imu, ros2::imu_of);
    if (!done || !is_status_due(samples, sample, message.log_time_ns)) return done;
    return topics_.write(
        samples.diagnostics,
        ros2::DiagnosticArray{.header = {.stamp = stamp},
                              .status = {ros2::status_of(samples.name, device, sample)}},
        message);
  }

  /// Whether the status changed, or is as old as it may become.
  static bool is_status_due(Samples& samples, const driver::Sample& sample, std::uint64_t now_ns) {
    const bool is_changed =
        samples.faults != sample.faults || samples.lifecycle != sample.lifecycle;
    if (!is_changed && now_ns < samples.diagnosed_ns + kDiagnosticsPeriodNs) return false;
    samples.faults = sample.faults;
    samples.lifecycle = sample.lifecycle;
    samples.diagnosed_ns = now_ns;
    return true;
  }

  expected<void, SetupError> copy_extras() {
    const auto metadata = reader_.read_metadata();
    if (!metadata) return unexpected{metadata.error()};
    for (const recording::Metadata& each : *metadata) {
      if (auto written = writer_.write(each); !written) return written;
    }
    const auto attachments = reader_.read_attachments();
    if (!attachments) return unexpected{attachments.error()};
    for (const recording::Attachment& each : *attachments) {
      if (auto written = writer_.write(each); !written) return written;
    }
    return {};
  }

  recording::FileReader& reader_;
  recording::FileWriter& writer_;
  const Ros2Options& options_;
  std::vector<Interval> intervals_{};
  Ros2Topics topics_;
  const recording::Progress& progress_;
  std::map<std::string, driver::Descriptor> devices_{};
  std::map<std::uint16_t, Samples> samples_{};
  std::map<std::uint16_t, Texts> texts_{};
  std::uint64_t message_count_ = 0;
  LeftOutCounter left_out_{};
};

}  // namespace

expected<Report, SetupError> export_ros2(recording::FileReader& reader, const std::string& path,
                                         const Ros2Options& options,
                                         const recording::Progress& progress) {
  auto made = recording::NewRecording::create(path, {.profile = "ros2"});
  if (!made) return unexpected{made.error()};
  auto report = Ros2Export(reader, made->writer(), options, progress).run();
  if (!report) return report;
  if (const auto finished = made->finish(); !finished) return unexpected{finished.error()};
  return report;
}

}  // namespace rtpm::exports
