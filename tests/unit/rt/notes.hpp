#pragma once

#include <gtest/gtest.h>

#include <optional>
#include <string>

#include "rtpm/rt/report.hpp"

namespace rtpm::rt {

/// The setup report's note about `subject`, if there is one.
[[nodiscard]] inline std::optional<SetupNote> note_of(const std::string& subject) {
  for (const SetupNote& note : setup_report()) {
    if (note.subject == subject) return note;
  }
  return std::nullopt;
}

/// How far the system granted it; fails the test if there is no note.
[[nodiscard]] inline Grant grant_of(const std::string& subject) {
  const auto note = note_of(subject);
  EXPECT_TRUE(note) << "no note about " << subject;
  return note ? note->grant : Grant::kGranted;
}

}  // namespace rtpm::rt
