#include "rtpm/capture/medium_recorder.hpp"

#include <algorithm>
#include <mutex>
#include <optional>
#include <utility>

#include "rtpm/capture/channels.hpp"
#include "rtpm/media/medium_reader.hpp"
#include "rtpm/rt/pi_mutex.hpp"
#include "rtpm/viewers/messages.hpp"

namespace rtpm::capture {
namespace {

/// How many pieces may be on the way: a recorder wants all, even if the disk was busy.
constexpr std::uint32_t kWindow = 32;

/// A channel of the file, with the type that it was added for.
struct PieceChannel {
  std::optional<viewers::Type> type{};
  std::uint16_t number = 0;  ///< 0: the file has no place for it.
};

std::optional<viewers::Type> type_of(media::Codec codec) {
  switch (codec) {
    case media::Codec::H264:
      return viewers::Type::kCompressedVideo;
    case media::Codec::Jpeg:
      return viewers::Type::kCompressedImage;
    case media::Codec::PcmS16:
      return viewers::Type::kRawAudio;
    case media::Codec::Opus:
    case media::Codec::Unknown:
      break;
  }
  return std::nullopt;
}

}  // namespace

struct MediumRecorder::Impl final : media::MediumSink {
  Impl(recording::Recorder& its_recorder, std::string its_name)
      : recorder(its_recorder), track(its_recorder.add_track()), name(std::move(its_name)) {}

  void on_description(const media::MediumDescriptionT& about) override {
    frame = about.frame;
    if (about.video) video_codec = about.video->codec;
    if (!about.sound) return;
    sound_codec = about.sound->codec;
    sample_rate_hz = about.sound->sample_rate_hz;
    sound_channel_count = about.sound->channel_count;
    if (sound_codec == media::Codec::Opus)
      on_problem(name + ": its sound is Opus, and recordings take PCM only; it is left out");
  }

  void on_video(const media::ReceivedPiece& piece) override {
    const std::uint64_t time_ns = recorder.log_time_ns(piece.captured);
    const viewers::Stamp stamp{.time_ns = time_ns, .frame = frame};
    const auto type = type_of(video_codec);
    if (!type) return;
    const bool is_image = type == viewers::Type::kCompressedImage;
    put(video, *type, "/video", piece,
        is_image ? viewers::image_message(stamp, "jpeg", piece.bytes)
                 : viewers::video_message(stamp, "h264", piece.bytes));
    count(&MediumRecorderStatus::video_count, video_lost, piece);
  }

  void on_sound(const media::ReceivedPiece& piece) override {
    const auto type = type_of(sound_codec);
    if (!type) return;
    put(sound, *type, "/sound", piece,
        viewers::audio_message(recorder.log_time_ns(piece.captured), piece.bytes, sample_rate_hz,
                               sound_channel_count));
    count(&MediumRecorderStatus::sound_count, sound_lost, piece);
  }

  void on_problem(const std::string& problem) override {
    const std::lock_guard lock(mutex);
    reports.push_back(problem);
  }

  void put(PieceChannel& channel, viewers::Type type, const char* leaf,
           const media::ReceivedPiece& piece, const viewers::Message& message) {
    if (channel.type != type) {
      channel = {.type = type, .number = add_channel(type, leaf, piece)};
      if (channel.number == 0) on_problem(name + leaf + ": the file has no channel left");
    }
    if (channel.number == 0) return;
    const std::uint64_t time_ns = recorder.log_time_ns(piece.captured);
    static_cast<void>(track.put({.channel_id = channel.number,
                                 .sequence = static_cast<std::uint32_t>(piece.sequence),
                                 .log_time_ns = time_ns,
                                 .publish_time_ns = time_ns,
                                 .data = message}));
  }

  std::uint16_t add_channel(viewers::Type type, const char* leaf,
                            const media::ReceivedPiece& piece) {
    const viewers::Schema schema = viewers::schema_of(type);
    const auto id =
        recorder.add_schema({.name = std::string(schema.name),
                             .encoding = "flatbuffer",
                             .data = {schema.reflection.begin(), schema.reflection.end()}});
    if (!id) return 0;
    const auto added = recorder.add_channel(
        {.schema_id = *id,
         .topic = name + leaf,
         .message_encoding = "flatbuffer",
         .metadata = {{kKindKey, kMediumKind},
                      {kDeviceKey, name},
                      {kUncertaintyKey, std::to_string(piece.uncertainty.count())}}});
    return added ? *added : std::uint16_t{0};
  }

  void count(std::uint64_t MediumRecorderStatus::*counter, std::uint64_t& lost,
             const media::ReceivedPiece& piece) {
    const std::lock_guard lock(mutex);
    ++(status.*counter);
    uncertainty = std::max(uncertainty, piece.uncertainty);
    // A new stream counts from 0 again.
    status.lost_count += piece.lost_count - std::min(lost, piece.lost_count);
    lost = piece.lost_count;
  }

  void finish() {
    if (!reader) return;
    reader->stop();
    reader.reset();
    const std::lock_guard lock(mutex);
    const auto written = recorder.write(recording::Metadata{
        .name = "rtpm.medium",
        .values = {{"medium", name},
                   {"video_count", std::to_string(status.video_count)},
                   {"sound_count", std::to_string(status.sound_count)},
                   {"lost_count", std::to_string(status.lost_count)},
                   {"uncertainty_ns_max", std::to_string(uncertainty.count())}}});
    // The recorder's status tells when the file is full.
    static_cast<void>(written);
  }

  recording::Recorder& recorder;
  recording::Recorder::Track& track;
  std::string name;
  // The reader's thread has these.
  std::string frame{};
  media::Codec video_codec = media::Codec::Unknown;
  media::Codec sound_codec = media::Codec::Unknown;
  std::uint32_t sample_rate_hz = 0;
  std::uint32_t sound_channel_count = 0;
  PieceChannel video{};
  PieceChannel sound{};
  std::uint64_t video_lost = 0;  ///< As the newest piece told.
  std::uint64_t sound_lost = 0;
  mutable rt::PiMutex mutex{};
  MediumRecorderStatus status{};  ///< Guarded by the mutex, as what follows.
  Duration uncertainty{};         ///< The largest one.
  std::vector<std::string> reports{};
  std::optional<media::MediumReader> reader{};
};

MediumRecorder::MediumRecorder(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
MediumRecorder::~MediumRecorder() {
  stop();
}

expected<std::unique_ptr<MediumRecorder>, SetupError> MediumRecorder::start(
    rpc::Node& node, recording::Recorder& recorder, const std::string& medium) {
  auto impl = std::make_unique<Impl>(recorder, medium);
  auto reader = media::MediumReader::start(node, medium, {.window = kWindow}, *impl);
  if (!reader) return unexpected{std::move(reader.error())};
  impl->reader.emplace(std::move(*reader));
  return std::unique_ptr<MediumRecorder>(new MediumRecorder(std::move(impl)));
}

MediumRecorderStatus MediumRecorder::status() const {
  const std::lock_guard lock(impl_->mutex);
  return impl_->status;
}

std::vector<std::string> MediumRecorder::take_reports() {
  const std::lock_guard lock(impl_->mutex);
  return std::exchange(impl_->reports, {});
}

void MediumRecorder::stop() noexcept {
  impl_->finish();
}

}  // namespace rtpm::capture
