#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "rtpm/base/setup_error.hpp"

namespace rtpm::recording {

/// A remark about a moment of a recording, made after it. Notes are beside the recording, in
/// FILE.notes.json, so that its bytes stay those that were recorded.
struct Note {
  std::uint64_t time_ns = 0;  ///< Log time, since 1970 in UTC.
  std::string text{};
  std::uint64_t made_ns = 0;  ///< When the note was made.
  friend bool operator==(const Note&, const Note&) = default;
};

inline constexpr std::size_t kNoteCountMax = 10'000;  ///< Per recording.
inline constexpr std::size_t kNoteSizeMax = 4096;     ///< Bytes of a note's text.

/// "run.mcap.notes.json".
[[nodiscard]] std::string notes_path(const std::string& recording);
/// The notes of a recording, by time; empty if it has none.
/// @errors   the file of notes can't be read, or is none
/// @realtime never
[[nodiscard]] expected<std::vector<Note>, SetupError> read_notes(const std::string& recording);
/// Replaces the notes of a recording; none are no file.
/// @errors   too many notes; an empty or too long text; the file can't be written, and is unchanged
/// @realtime never
[[nodiscard]] expected<void, SetupError> write_notes(const std::string& recording,
                                                     std::vector<Note> notes);

}  // namespace rtpm::recording
