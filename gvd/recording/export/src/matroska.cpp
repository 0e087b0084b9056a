#include "matroska.hpp"

#include <algorithm>
#include <bit>
#include <cerrno>
#include <limits>
#include <string_view>
#include <utility>

#include "nal_units.hpp"
#include "os/file.hpp"

namespace rtpm::exports {
namespace {

using Buffer = std::vector<std::byte>;

// Element numbers of RFC 8794 and RFC 9559.
constexpr std::uint32_t kHead = 0x1A45DFA3;
constexpr std::uint32_t kDocType = 0x4282;
constexpr std::uint32_t kDocTypeVersion = 0x4287;
constexpr std::uint32_t kDocTypeReadVersion = 0x4285;
constexpr std::uint32_t kSegment = 0x18538067;
constexpr std::uint32_t kInfo = 0x1549A966;
constexpr std::uint32_t kTimestampScale = 0x2AD7B1;
constexpr std::uint32_t kDuration = 0x4489;
constexpr std::uint32_t kDateUtc = 0x4461;
constexpr std::uint32_t kMuxingApp = 0x4D80;
constexpr std::uint32_t kWritingApp = 0x5741;
constexpr std::uint32_t kTracks = 0x1654AE6B;
constexpr std::uint32_t kTrackEntry = 0xAE;
constexpr std::uint32_t kTrackNumber = 0xD7;
constexpr std::uint32_t kTrackUid = 0x73C5;
constexpr std::uint32_t kTrackType = 0x83;
constexpr std::uint32_t kFlagLacing = 0x9C;
constexpr std::uint32_t kCodecId = 0x86;
constexpr std::uint32_t kCodecPrivate = 0x63A2;
constexpr std::uint32_t kVideo = 0xE0;
constexpr std::uint32_t kPixelWidth = 0xB0;
constexpr std::uint32_t kPixelHeight = 0xBA;
constexpr std::uint32_t kAudio = 0xE1;
constexpr std::uint32_t kSamplingFrequency = 0xB5;
constexpr std::uint32_t kChannels = 0x9F;
constexpr std::uint32_t kBitDepth = 0x6264;
constexpr std::uint32_t kCluster = 0x1F43B675;
constexpr std::uint32_t kTimestamp = 0xE7;
constexpr std::uint32_t kSimpleBlock = 0xA3;

constexpr std::uint64_t kUnitNs = 1000;  // Times in the file are in microseconds.
/// Matroska counts dates from 2001-01-01.
constexpr std::uint64_t kMillenniumNs = 978'307'200'000'000'000;

void append(Buffer& buffer, std::uint64_t value, int byte_count) {
  for (int i = byte_count - 1; i >= 0; --i)
    buffer.push_back(static_cast<std::byte>(value >> (8 * i)));
}
void append(Buffer& buffer, ConstBytes bytes) {
  buffer.insert(buffer.end(), bytes.begin(), bytes.end());
}

void append_id(Buffer& buffer, std::uint32_t id) {
  append(buffer, id, (static_cast<int>(std::bit_width(id)) + 7) / 8);
}

void append_element(Buffer& buffer, std::uint32_t id, ConstBytes content) {
  append_id(buffer, id);
  // A size of eight bytes always: the first has only its marker.
  append(buffer, std::uint64_t{1} << 56 | content.size(), 8);
  append(buffer, content);
}
void append_number(Buffer& buffer, std::uint32_t id, std::uint64_t value) {
  Buffer content;
  append(content, value, 8);
  append_element(buffer, id, content);
}
void append_real(Buffer& buffer, std::uint32_t id, double value) {
  append_number(buffer, id, std::bit_cast<std::uint64_t>(value));
}
void append_text(Buffer& buffer, std::uint32_t id, std::string_view text) {
  append_element(buffer, id, std::as_bytes(std::span(text)));
}

/// AVCDecoderConfigurationRecord, ISO/IEC 14496-15, 5.3.3.1; empty without both parameter sets.
Buffer decoder_configuration(ConstBytes annex_b) {
  ConstBytes sequence;
  ConstBytes picture;
  for (const ConstBytes unit : nal_units(annex_b)) {
    if (kind_of(unit) == NalKind::kSequenceParameters) sequence = unit;
    if (kind_of(unit) == NalKind::kPictureParameters) picture = unit;
  }
  constexpr std::size_t kUnitMax = std::numeric_limits<std::uint16_t>::max();
  if (sequence.size() < 4 || picture.empty() || sequence.size() > kUnitMax ||
      picture.size() > kUnitMax) {
    return {};
  }
  Buffer record{
      std::byte{1},    sequence[1],    sequence[2], sequence[3],
      std::byte{0xff}, std::byte{0xe1}};  // Sizes of four bytes; one sequence parameter set.
  append(record, sequence.size(), 2);
  append(record, sequence);
  record.push_back(std::byte{1});
  append(record, picture.size(), 2);
  append(record, picture);
  return record;
}

/// The picture with sizes in place of start codes.
Buffer with_sizes(ConstBytes annex_b) {
  Buffer sized;
  sized.reserve(annex_b.size() + 16);
  for (const ConstBytes unit : nal_units(annex_b)) {
    if (kind_of(unit) == NalKind::kDelimiter) continue;
    append(sized, unit.size(), 4);
    append(sized, unit);
  }
  return sized;
}

Buffer video_entry(const VideoTrack& track, const Buffer& configuration) {
  Buffer video;
  append_number(video, kPixelWidth, track.width_px);
  append_number(video, kPixelHeight, track.height_px);
  Buffer entry;
  append_number(entry, kTrackNumber, MatroskaFile::kVideoNumber);
  append_number(entry, kTrackUid, MatroskaFile::kVideoNumber);
  append_number(entry, kTrackType, 1);
  append_number(entry, kFlagLacing, 0);
  append_text(entry, kCodecId, track.is_h264 ? "V_MPEG4/ISO/AVC" : "V_MJPEG");
  if (track.is_h264) append_element(entry, kCodecPrivate, configuration);
  append_element(entry, kVideo, video);
  return entry;
}

Buffer sound_entry(const SoundTrack& track) {
  Buffer audio;
  append_real(audio, kSamplingFrequency, track.sample_rate_hz);
  append_number(audio, kChannels, track.channel_count);
  append_number(audio, kBitDepth, 16);
  Buffer entry;
  append_number(entry, kTrackNumber, MatroskaFile::kSoundNumber);
  append_number(entry, kTrackUid, MatroskaFile::kSoundNumber);
  append_number(entry, kTrackType, 2);
  append_number(entry, kFlagLacing, 0);
  append_text(entry, kCodecId, "A_PCM/INT/LIT");
  append_element(entry, kAudio, audio);
  return entry;
}

}  // namespace

bool is_key_frame(ConstBytes annex_b) noexcept {
  const auto units = nal_units(annex_b);
  return std::ranges::any_of(units,
                             [](ConstBytes unit) { return kind_of(unit) == NalKind::kKeySlice; });
}

expected<MatroskaFile, SetupError> MatroskaFile::create(const std::string& path,
                                                        std::uint64_t begin_ns,
                                                        const VideoTrack& video,
                                                        const std::optional<SoundTrack>& sound) {
  const Buffer configuration =
      video.is_h264 ? decoder_configuration(video.parameter_sets) : Buffer{};
  if (video.is_h264 && configuration.empty()) {
    return setup_error("the first picture can't be decoded",
                       "it has no sequence and picture parameter sets",
                       "let the encoder repeat them with each key frame");
  }
  std::FILE* const opened = os::create(path);
  if (opened == nullptr) return setup_error("'" + path + "' can't be written", system_error(errno));
  MatroskaFile file(path, opened);
  file.begin_ns_ = file.end_ns_ = begin_ns;
  file.is_h264_ = video.is_h264;
  Buffer head;
  append_text(head, kDocType, "matroska");
  append_number(head, kDocTypeVersion, 4);
  append_number(head, kDocTypeReadVersion, 2);
  Buffer bytes;
  append_element(bytes, kHead, head);
  append_id(bytes, kSegment);
  append(bytes, (std::uint64_t{1} << 57) - 1, 8);  // Its size is not known.
  Buffer info;
  append_number(info, kTimestampScale, kUnitNs);
  append_number(info, kDateUtc, begin_ns - kMillenniumNs);
  append_text(info, kMuxingApp, "RTPM");
  append_text(info, kWritingApp, "rtpm bag export");
  append_real(info, kDuration, 0);
  append_element(bytes, kInfo, info);
  file.duration_at_ = static_cast<long>(bytes.size() - sizeof(double));
  Buffer tracks;
  append_element(tracks, kTrackEntry, video_entry(video, configuration));
  if (sound) append_element(tracks, kTrackEntry, sound_entry(*sound));
  append_element(bytes, kTracks, tracks);
  if (auto written = file.write(bytes); !written) return unexpected{written.error()};
  return file;
}

// Each block has a cluster of its own, as a block's own time reaches 32 ms only.
expected<void, SetupError> MatroskaFile::put(std::uint64_t track, std::uint64_t time_ns,
                                             ConstBytes data, bool is_key) {
  end_ns_ = std::max(end_ns_, time_ns);
  Buffer block;
  block.push_back(static_cast<std::byte>(0x80 | track));
  append(block, 0, 2);
  block.push_back(is_key ? std::byte{0x80} : std::byte{0});
  const bool is_h264 = track == kVideoNumber && is_h264_;
  append(block, is_h264 ? ConstBytes(with_sizes(data)) : data);
  Buffer cluster;
  append_number(cluster, kTimestamp, (time_ns - begin_ns_) / kUnitNs);
  append_element(cluster, kSimpleBlock, block);
  Buffer bytes;
  append_element(bytes, kCluster, cluster);
  return write(bytes);
}

expected<void, SetupError> MatroskaFile::write(const std::vector<std::byte>& bytes) {
  if (std::fwrite(bytes.data(), 1, bytes.size(), file_.get()) == bytes.size()) return {};
  return unexpected{failure()};
}

SetupError MatroskaFile::failure() const {
  const std::error_code cause = system_error(errno);
  return {"'" + path_ + "' can't be written", cause.message(), "make room on the disk", cause};
}

expected<void, SetupError> MatroskaFile::finish() {
  Buffer duration;
  append(duration, std::bit_cast<std::uint64_t>(static_cast<double>(end_ns_ - begin_ns_) / kUnitNs),
         sizeof(double));
  if (std::fseek(file_.get(), duration_at_, SEEK_SET) != 0) return unexpected{failure()};
  if (auto written = write(duration); !written) return written;
  if (std::fclose(file_.release()) != 0) return unexpected{failure()};
  return {};
}

}  // namespace rtpm::exports
