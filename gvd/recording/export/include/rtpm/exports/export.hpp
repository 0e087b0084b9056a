#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/recording/file_reader.hpp"

/// Recordings as files of other systems.
namespace rtpm::exports {

/// A channel, or messages of one, that an export could not convert.
struct LeftOut {
  std::string topic;
  std::string reason;  ///< A clause: "its schema can't be read".
  std::uint64_t message_count = 0;
};

struct Report {
  std::uint64_t message_count = 0;  ///< Converted ones.
  std::size_t topic_count = 0;      ///< Topics or files of the result.
  std::vector<LeftOut> left_out{};
};

/// Writes a folder with one CSV file per channel, and `recording.json` with the recording's times,
/// channels and metadata. The folder appears when it is complete.
/// @errors   the folder exists or can't be written; those of FileReader::read(); stopped
/// @realtime never
[[nodiscard]] expected<Report, SetupError> export_csv(recording::FileReader& reader,
                                                      const std::string& folder,
                                                      const recording::Progress& progress = {});

/// Writes a recording of the profile `ros2`, whose messages are of ROS 2's standard types only.
/// @errors   the file exists or can't be written; two names become the same in ROS 2; those of
///           FileReader::read(); stopped
/// @realtime never
[[nodiscard]] expected<Report, SetupError> export_ros2(recording::FileReader& reader,
                                                       const std::string& path,
                                                       const recording::Progress& progress = {});

}  // namespace rtpm::exports
