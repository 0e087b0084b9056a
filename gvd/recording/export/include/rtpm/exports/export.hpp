#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/recording/file_reader.hpp"
#include "rtpm/recording/notes.hpp"

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
  std::uint64_t row_count = 0;      ///< Rows of tables at a rate, or of a joined one.
  /// Values that came more than a second after later ones of other topics; they are in the rows of
  /// the time when they came.
  std::uint64_t late_count = 0;
  std::vector<LeftOut> left_out{};
};

/// The part of a recording that is exported; if several are given, what all have in common.
struct Part {
  std::optional<double> from_s{};  ///< Seconds from the recording's begin.
  std::optional<double> to_s{};
  /// From the first mark with the first label, to the next one with the second.
  std::optional<std::pair<std::string, std::string>> between{};
  std::optional<std::uint32_t> trial{};    ///< All trials of this number.
  std::optional<std::string> condition{};  ///< All trials of this condition.
};

/// Chooses the content of tables. In patterns, `*` is any text and `?` any character.
struct TableOptions {
  std::vector<std::string> topics{};   ///< Patterns of topics or of devices' names; empty: all.
  std::vector<std::string> columns{};  ///< Patterns of columns' names; empty: all.
  Part part{};
  /// One table with the numbers and texts of all topics, and with marks and trials. Each value is
  /// held until the next one.
  bool is_joined = false;
  /// Rows at this rate, with the last value before each; 0: rows as recorded.
  double rate_hz = 0;
  /// Those beside the recording: marks of the joined table and of `part`, and `notes.csv`.
  std::vector<recording::Note> notes{};
};

/// The most rows of a table at a rate.
inline constexpr double kRowCountMax = 2e9;

/// The names of a recording that TableOptions can have; at most 1000 of each.
struct TableChoices {
  std::vector<std::string> topics{};
  std::vector<std::uint32_t> trials{};
  std::vector<std::string> conditions{};
  std::vector<std::string> marks{};
};

/// @param notes  those beside the recording, which are among its marks
/// @errors   those of FileReader::read(); stopped
/// @realtime never
[[nodiscard]] expected<TableChoices, SetupError> choices_of(
    recording::FileReader& reader, std::vector<recording::Note> notes = {},
    const recording::Progress& progress = {});

/// Writes a folder with one CSV file per channel, or `joined.csv`; with `trials.csv` if the
/// recording has trials; with `notes.csv` if there are notes in the part; and with
/// `recording.json`: the recording's times, channels and metadata.
/// The folder appears when it is complete. Memory does not depend on the recording's size.
/// @errors   the folder exists or can't be written; a pattern, mark or trial that the recording
///           does not have; too many rows; those of FileReader::read(); stopped
/// @realtime never
[[nodiscard]] expected<Report, SetupError> export_csv(recording::FileReader& reader,
                                                      const std::string& folder,
                                                      const TableOptions& options = {},
                                                      const recording::Progress& progress = {});

/// Chooses the messages for ROS 2.
struct Ros2Options {
  Part part{};
  std::vector<recording::Note> notes{};  ///< Those beside the recording: marks of `part`.
};

/// Writes a recording of the profile `ros2`, whose messages are of ROS 2's standard types only. One
/// of a part begins with the descriptions of the devices.
/// @errors   the file exists or can't be written; two names become the same in ROS 2; a mark or
///           trial that the recording does not have; those of FileReader::read(); stopped
/// @realtime never
[[nodiscard]] expected<Report, SetupError> export_ros2(recording::FileReader& reader,
                                                       const std::string& path,
                                                       const Ros2Options& options = {},
                                                       const recording::Progress& progress = {});

}  // namespace rtpm::exports
