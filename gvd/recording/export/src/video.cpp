#include "rtpm/exports/video.hpp"

#include <cstdio>
#include <optional>
#include <string_view>
#include <utility>

#include "matroska.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/viewers/pictures.hpp"

namespace rtpm::exports {
namespace {

constexpr std::string_view kVideoLeaf = "/video";
constexpr std::string_view kSoundLeaf = "/sound";

/// A channel of pictures.
struct Camera {
  std::string name{};
  std::uint16_t channel = 0;
  viewers::Type type{};
};

std::optional<viewers::Type> type_of(const recording::FileReader& reader,
                                     const recording::Channel& channel) {
  const auto schema = reader.schemas().find(channel.schema_id);
  if (schema == reader.schemas().end() || schema->second.encoding != "flatbuffer")
    return std::nullopt;
  for (const viewers::Type type : {viewers::Type::kCompressedVideo, viewers::Type::kCompressedImage,
                                   viewers::Type::kRawAudio}) {
    if (schema->second.name == viewers::schema_of(type).name) return type;
  }
  return std::nullopt;
}

std::string medium_of(const std::string& topic, std::string_view leaf) {
  return topic.ends_with(leaf) ? topic.substr(0, topic.size() - leaf.size()) : topic;
}

expected<Camera, SetupError> find_camera(const recording::FileReader& reader,
                                         const std::string& medium) {
  std::optional<Camera> found;
  std::string names;
  int count = 0;
  for (const auto& [number, channel] : reader.channels()) {
    const auto type = type_of(reader, channel);
    if (!type || *type == viewers::Type::kRawAudio) continue;
    const std::string name = medium_of(channel.topic, kVideoLeaf);
    names += (names.empty() ? "" : ", ") + printable(name);
    ++count;
    if (medium.empty() || medium == name) found = Camera{name, number, *type};
  }
  if (count == 0) {
    return setup_error("the recording has no pictures", "",
                       "record a camera by rtpm record --media NAME");
  }
  if (!found || (medium.empty() && count > 1)) {
    return setup_error(medium.empty() ? "the recording has several cameras"
                                      : "the recording has no camera " + printable(medium),
                       "it has " + names, "name one by --medium");
  }
  return *found;
}

std::optional<std::uint16_t> find_sound(const recording::FileReader& reader,
                                        const std::string& medium) {
  for (const auto& [number, channel] : reader.channels()) {
    if (type_of(reader, channel) == viewers::Type::kRawAudio &&
        medium_of(channel.topic, kSoundLeaf) == medium) {
      return number;
    }
  }
  return std::nullopt;
}

class VideoExport {
 public:
  VideoExport(recording::FileReader& reader, std::string path, Camera camera)
      : reader_(reader),
        path_(std::move(path)),
        camera_(std::move(camera)),
        sound_(find_sound(reader, camera_.name)) {}

  expected<VideoReport, SetupError> run(const recording::Progress& progress) {
    report_.medium = camera_.name;
    if (auto learned = learn_sound(); !learned) return unexpected{learned.error()};
    recording::Query query{.channel_ids = {camera_.channel}};
    if (sound_) query.channel_ids.push_back(*sound_);
    expected<void, SetupError> done{};
    const auto read = reader_.read(
        query,
        [&](const recording::Message& message) {
          done = take(message);
          return done.has_value();
        },
        progress);
    if (!read) done = read;
    if (done && !file_) {
      done = setup_error(
          "the recording has no picture of " + printable(camera_.name) + " that can be decoded", "",
          "record at least up to the next key frame");
    }
    if (done) done = file_->finish();
    if (done) return report_;
    if (file_) static_cast<void>(std::remove(path_.c_str()));
    return unexpected{done.error()};
  }

 private:
  /// The sound track is described before the first picture.
  expected<void, SetupError> learn_sound() {
    if (!sound_) return {};
    return reader_.read({.channel_ids = {*sound_}}, [this](const recording::Message& message) {
      const auto sound = viewers::sound_in(message.data);
      if (!sound) return true;
      track_ = SoundTrack{sound->sample_rate_hz, sound->channel_count};
      return false;
    });
  }

  expected<void, SetupError> take(const recording::Message& message) {
    if (message.channel_id != camera_.channel) return take_sound(message);
    const auto picture = viewers::picture_in(camera_.type, message.data);
    if (!picture) return leave_out();
    const bool is_h264 = camera_.type == viewers::Type::kCompressedVideo;
    const bool is_key = !is_h264 || is_key_frame(*picture);
    if (!file_) {
      const auto size = is_h264 ? size_of_h264(*picture) : size_of_jpeg(*picture);
      if (!is_key || !size) return leave_out();
      auto created = MatroskaFile::create(path_, message.log_time_ns,
                                          {.is_h264 = is_h264,
                                           .width_px = size->width_px,
                                           .height_px = size->height_px,
                                           .parameter_sets = *picture},
                                          track_);
      if (!created) return unexpected{std::move(created.error())};
      file_.emplace(std::move(*created));
    }
    ++report_.picture_count;
    return file_->put(MatroskaFile::kVideoNumber, message.log_time_ns, *picture, is_key);
  }

  expected<void, SetupError> take_sound(const recording::Message& message) {
    const auto sound = viewers::sound_in(message.data);
    // The file begins with its first picture.
    if (!sound || !file_) return {};
    ++report_.sound_count;
    return file_->put(MatroskaFile::kSoundNumber, message.log_time_ns, sound->data, true);
  }

  expected<void, SetupError> leave_out() {
    ++report_.left_out_count;
    return {};
  }

  recording::FileReader& reader_;
  std::string path_;
  Camera camera_;
  std::optional<std::uint16_t> sound_;
  std::optional<SoundTrack> track_{};
  std::optional<MatroskaFile> file_{};
  VideoReport report_{};
};

}  // namespace

expected<VideoReport, SetupError> export_video(recording::FileReader& reader,
                                               const std::string& path, const std::string& medium,
                                               const recording::Progress& progress) {
  auto camera = find_camera(reader, medium);
  if (!camera) return unexpected{std::move(camera.error())};
  return VideoExport(reader, path, std::move(*camera)).run(progress);
}

}  // namespace rtpm::exports
