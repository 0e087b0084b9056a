#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/setup_error.hpp"

namespace rtpm::exports {

/// The video track of a Matroska file.
struct VideoTrack {
  bool is_h264 = true;  ///< Else JPEG.
  std::uint32_t width_px = 0;
  std::uint32_t height_px = 0;
  ConstBytes parameter_sets{};  ///< H.264: Annex B with SPS and PPS, such as the first key frame.
};

/// A sound track of 16-bit samples.
struct SoundTrack {
  std::uint32_t sample_rate_hz = 0;
  std::uint32_t channel_count = 0;
};

/// Writes a Matroska file (.mkv): a block for each picture and piece of sound, times in
/// microseconds, and the date of the first one to the nanosecond.
/// @ownership owns the file
/// @threads  one
/// @source   RFC 9559; for H.264 the AVCC form of ISO/IEC 14496-15
class MatroskaFile {
 public:
  static constexpr std::uint64_t kVideoNumber = 1;
  static constexpr std::uint64_t kSoundNumber = 2;

  /// @param begin_ns  time 0 of the file, since 1970 in UTC
  /// @errors   the file exists or can't be written; the parameter sets are missing
  [[nodiscard]] static expected<MatroskaFile, SetupError> create(
      const std::string& path, std::uint64_t begin_ns, const VideoTrack& video,
      const std::optional<SoundTrack>& sound);

  /// Adds a picture or a piece of sound; an H.264 picture in Annex B.
  /// @param time_ns  since 1970 in UTC
  /// @errors   the file can't be written
  [[nodiscard]] expected<void, SetupError> put(std::uint64_t track, std::uint64_t time_ns,
                                               ConstBytes data, bool is_key);
  /// Completes the file.
  /// @errors   the file can't be written
  [[nodiscard]] expected<void, SetupError> finish();

 private:
  struct Close {
    void operator()(std::FILE* file) const noexcept { static_cast<void>(std::fclose(file)); }
  };
  MatroskaFile(std::string path, std::FILE* file) : path_(std::move(path)), file_(file) {}
  [[nodiscard]] expected<void, SetupError> write(const std::vector<std::byte>& bytes);
  [[nodiscard]] SetupError failure() const;

  std::string path_;
  std::unique_ptr<std::FILE, Close> file_;
  std::uint64_t begin_ns_ = 0;
  std::uint64_t end_ns_ = 0;
  long duration_at_ = 0;  ///< Where the duration is in the file.
  bool is_h264_ = true;
};

/// Whether an H.264 picture in Annex B is a key frame (IDR).
[[nodiscard]] bool is_key_frame(ConstBytes annex_b) noexcept;

/// Width and height of the pictures that a sequence parameter set describes, or that a JPEG has;
/// nullopt if `picture` has neither.
struct PictureSize {
  std::uint32_t width_px = 0;
  std::uint32_t height_px = 0;
};
[[nodiscard]] std::optional<PictureSize> size_of_h264(ConstBytes annex_b);
[[nodiscard]] std::optional<PictureSize> size_of_jpeg(ConstBytes jpeg);

}  // namespace rtpm::exports
