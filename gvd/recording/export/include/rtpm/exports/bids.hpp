#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "rtpm/exports/export.hpp"
#include "rtpm/recording/file_reader.hpp"
#include "rtpm/recording/notes.hpp"

namespace rtpm::exports {

/// The name of the metadata that a session's recordings have; its keys are `participant`,
/// `experiment`, `condition` and `notes`.
inline constexpr const char* kSessionMetadata = "rtpm.session";

/// Names in a BIDS data set; letters and digits of them remain. An empty one is that of the
/// recording's session.
struct BidsOptions {
  std::string participant{};  ///< "P07".
  std::string task{};         ///< The experiment; "recording" if there is none.
  std::string session{};      ///< Left out if it is empty.
  std::optional<std::uint32_t> run{};
  std::vector<std::string> topics{};     ///< Patterns of topics or of devices' names; empty: all.
  double rate_hz = 0;                    ///< 0: each device's mean rate, rounded to 1 Hz.
  std::vector<recording::Note> notes{};  ///< Those beside the recording: further events.
};

/// Adds a recording to a data set in the layout of BIDS, a new one or one that exists: samples of
/// biometric devices as physiological recordings, those of other devices as motion, trials and
/// marks as events. Samples are at a fixed rate, each the last one before. Files appear when all
/// are complete.
/// @errors   no participant is named; the folder is no data set; a file is there already; the
///           events need more than 256 MiB; those of FileReader::read(); stopped
/// @realtime never
/// @source   BIDS 1.10: behavioural experiments, physiological recordings, motion
[[nodiscard]] expected<Report, SetupError> export_bids(recording::FileReader& reader,
                                                       const std::string& folder,
                                                       const BidsOptions& options,
                                                       const recording::Progress& progress = {});

}  // namespace rtpm::exports
