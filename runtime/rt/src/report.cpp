#include "rtpm/rt/report.hpp"

#include <algorithm>
#include <cstdio>
#include <mutex>
#include <utility>

#include "rtpm/rt/pi_mutex.hpp"

namespace rtpm::rt {
namespace {

// Created at first use and never freed: threads may outlive main().
struct Notes {
  PiMutex mutex;
  std::vector<SetupNote> list;
};
Notes& notes() {
  static auto* const all = new Notes;
  return *all;
}

}  // namespace

std::string_view to_string(Grant grant) noexcept {
  switch (grant) {
    case Grant::kGranted:
      return "granted";
    case Grant::kPartly:
      return "partly";
    case Grant::kRefused:
      return "refused";
    case Grant::kNotAsked:
      return "not asked";
  }
  return "unknown";
}

std::vector<SetupNote> setup_report() {
  const std::lock_guard lock(notes().mutex);
  return notes().list;
}

void note_setup(SetupNote note) {
  const std::lock_guard lock(notes().mutex);
  auto& list = notes().list;
  const auto known = std::ranges::find(list, note.subject, &SetupNote::subject);
  if (known != list.end()) {
    *known = std::move(note);
  } else if (list.size() < kSetupNoteCountMax) {
    list.push_back(std::move(note));
  }
}

void RepeatedWarning::say(std::string_view text, MonotonicTime now) noexcept {
  if (now < next_) {
    ++kept_count_;
    return;
  }
  next_ = now + kInterval;
  const int size = static_cast<int>(text.size());
  if (kept_count_ == 0) {
    std::fprintf(stderr, "rtpm: warning: %.*s\n", size, text.data());
  } else {
    std::fprintf(stderr, "rtpm: warning: %.*s (And %llu times before.)\n", size, text.data(),
                 static_cast<unsigned long long>(kept_count_));
  }
  kept_count_ = 0;
}

std::string to_text(const std::vector<SetupNote>& list) {
  std::size_t width = 0;
  for (const SetupNote& note : list)
    width = std::max(width, note.subject.size());
  constexpr std::size_t kGrantWidth = 11;
  std::string text;
  for (const SetupNote& note : list) {
    const std::string grant(to_string(note.grant));
    text += note.subject + std::string(width - note.subject.size() + 2, ' ') + grant +
            std::string(kGrantWidth - grant.size(), ' ') + note.text + "\n";
    if (!note.remedy.empty()) {
      text += std::string(width + 2 + kGrantWidth, ' ') + "Remedy: " + note.remedy + "\n";
    }
  }
  return text;
}

}  // namespace rtpm::rt
