#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/time.hpp"

namespace rtpm::rt {

/// How far the system granted a request.
enum class Grant : std::uint8_t {
  kGranted,
  kPartly,    ///< It works, but with limits; the remedy says what would help.
  kRefused,   ///< It does not work; the text names the fallback.
  kNotAsked,  ///< The configuration did not request it.
};

/// "granted", "partly", "refused" or "not asked".
[[nodiscard]] std::string_view to_string(Grant grant) noexcept;

/// One request to the system and its result, as text.
struct SetupNote {
  std::string subject;  ///< "thread 'lane-0'", "memory lock".
  Grant grant = Grant::kGranted;
  std::string text;    ///< The result, a clause.
  std::string remedy;  ///< The user's remedy; empty if none is needed.
};

/// The most subjects that are kept; later ones are dropped.
inline constexpr std::size_t kSetupNoteCountMax = 256;

/// This process's requests to the system so far: threads, memory, CPU latency. Each subject appears
/// once, with its latest result.
/// @threads  any
/// @realtime set-up only
[[nodiscard]] std::vector<SetupNote> setup_report();

/// The notes as lines, each with its remedy below.
/// @realtime set-up only
[[nodiscard]] std::string to_text(const std::vector<SetupNote>& notes);

/// A warning that may recur often. It is printed on standard error at once, then at most every
/// kInterval, with the number of occurrences since.
/// @threads  one; not for lanes
class RepeatedWarning {
 public:
  static constexpr Duration kInterval = std::chrono::seconds{10};
  /// Prints "rtpm: warning: <text>" if due at `now`. Allocates nothing.
  void say(std::string_view text, MonotonicTime now) noexcept;

 private:
  MonotonicTime next_ = MonotonicTime::min();
  std::uint64_t kept_count_ = 0;  ///< Occurrences since it was last printed.
};

/// Adds a note to setup_report(), replacing the one with the same subject.
/// @threads  any; set-up only
void note_setup(SetupNote note);

}  // namespace rtpm::rt
