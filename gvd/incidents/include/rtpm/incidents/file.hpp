#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/incidents/incident.hpp"

namespace rtpm::incidents {

/// The usual file of incidents, $XDG_STATE_HOME/rtpm/incidents.jsonl; empty if the environment
/// names no folder.
[[nodiscard]] std::string default_file();

/// An incident as JSON, as in the file.
[[nodiscard]] std::string to_json(const Incident& incident);

/// The content of a file of incidents.
struct Content {
  std::vector<Incident> incidents{};  ///< By rising id, the newest state of each.
  std::size_t line_count = 0;
  std::size_t torn_count = 0;    ///< Lines that are none, such as the last one of a full disk.
  std::uint64_t byte_count = 0;  ///< Up to the end of the last whole line.
};

/// Reads a file of incidents; one that does not exist is empty.
/// @errors   it can't be read, or is larger than 256 MiB
[[nodiscard]] expected<Content, SetupError> read_file(const std::string& path);

/// Acknowledges incidents in a file that a console may have open, which sees it within a second.
/// @param ids  incidents of the file
/// @errors   it can't be written
[[nodiscard]] expected<void, SetupError> acknowledge_in_file(const std::string& path,
                                                             std::span<const std::uint64_t> ids,
                                                             std::string_view person,
                                                             std::uint64_t utc_ns);

/// The file of one console: a line of JSON per change, appended whole.
/// @threads  one
/// @realtime set-up only: waits for the disk
class IncidentFile {
 public:
  /// An acknowledgement that another program has appended.
  struct Acknowledgement {
    std::uint64_t id = 0;
    std::string person{};
    std::uint64_t utc_ns = 0;
  };
  /// Opens the file, creates it and its folder if they do not exist, and keeps others from doing so.
  /// Writes it anew if most of its lines are superseded.
  /// @errors   it can't be read or written; another console has it open
  [[nodiscard]] static expected<IncidentFile, SetupError> open(const std::string& path,
                                                               Content& content);
  IncidentFile(IncidentFile&& other) noexcept;
  IncidentFile& operator=(IncidentFile&& other) noexcept;
  ~IncidentFile();

  /// @errors   the disk is full, or fails; a part of the lines may be there
  [[nodiscard]] expected<void, SetupError> append(std::span<const Incident> incidents);
  /// The acknowledgements that other programs have appended since the last call.
  [[nodiscard]] std::vector<Acknowledgement> read_others();
  /// Whether it is so long that it should be written anew, by rewrite().
  [[nodiscard]] bool is_long() const noexcept;
  /// @errors   the old file is unchanged
  [[nodiscard]] expected<void, SetupError> rewrite(std::span<const Incident> incidents);
  [[nodiscard]] const std::string& path() const noexcept { return path_; }

 private:
  IncidentFile() = default;
  std::string path_{};
  int lock_ = -1;
  std::uint64_t read_to_ = 0;
  std::uint64_t rewritten_size_ = 0;
};

}  // namespace rtpm::incidents
