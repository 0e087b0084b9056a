#pragma once

#include <cstdint>
#include <string>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/recording/file_reader.hpp"

namespace rtpm::exports {

/// The result of export_video().
struct VideoReport {
  std::string medium{};  ///< "lab/cam0".
  std::uint64_t picture_count = 0;
  std::uint64_t sound_count = 0;
  /// Pictures before the first key frame, which can't be decoded, and messages without a picture.
  std::uint64_t left_out_count = 0;
};

/// Writes the pictures of a recorded camera, and its sound, as a Matroska file (.mkv), without
/// encoding them again. The file's times are those of capture.
/// @param medium  "lab/cam0"; empty: the only one
/// @errors   no such camera, or several and no name; no key frame; the file exists or can't be
///           written; those of FileReader::read(); stopped
/// @realtime never
[[nodiscard]] expected<VideoReport, SetupError> export_video(
    recording::FileReader& reader, const std::string& path, const std::string& medium = {},
    const recording::Progress& progress = {});

}  // namespace rtpm::exports
