#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/time.hpp"

namespace rtpm::rt {

/// How far the system gave what was asked.
enum class Grant : std::uint8_t {
  kGranted,
  kPartly,    ///< It works, but something bounds how well; the remedy says what would help.
  kRefused,   ///< It does not; what stands in its place is said.
  kNotAsked,  ///< The configuration did not want it.
};

/// "granted", "partly", "refused" or "not asked".
[[nodiscard]] std::string_view to_string(Grant grant) noexcept;

/// One thing that was asked of the system, and what came of it, in words.
struct SetupNote {
  std::string subject;  ///< "thread 'lane-0'", "memory lock".
  Grant grant = Grant::kGranted;
  std::string text;    ///< What is so, a clause.
  std::string remedy;  ///< What the user can do about it; empty: nothing is needed.
};

/// How many subjects are kept at most: who started more threads sees the first ones.
inline constexpr std::size_t kSetupNoteCountMax = 256;

/// What this process asked of the system so far: threads, memory, CPU latency. Each subject once,
/// as it was last.
/// @threads  any
/// @realtime set-up only
[[nodiscard]] std::vector<SetupNote> setup_report();

/// The notes as lines, each with its remedy below.
/// @realtime set-up only
[[nodiscard]] std::string to_text(const std::vector<SetupNote>& notes);

/// A warning that may be due often: it is said on standard error at once, and then at most every
/// kInterval, with how often it was due meanwhile.
/// @threads  one. Not for lanes
class RepeatedWarning {
 public:
  static constexpr Duration kInterval = std::chrono::seconds{10};
  /// Prints "rtpm: warning: <text>", where that is due at `now`. Allocates nothing.
  void say(std::string_view text, MonotonicTime now) noexcept;

 private:
  MonotonicTime next_ = MonotonicTime::min();
  std::uint64_t kept_count_ = 0;  ///< How often it was due since it was said.
};

/// Adds a note to setup_report(), in place of the one with its subject.
/// @threads  any. Set-up only
void note_setup(SetupNote note);

}  // namespace rtpm::rt
