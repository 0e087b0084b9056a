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
  kPartly,    ///< It works, but something bounds how well; the remedy says what would help.
  kRefused,   ///< It does not work; the text names the substitute.
  kNotAsked,  ///< The configuration did not want it.
};

/// "granted", "partly", "refused" or "not asked".
[[nodiscard]] std::string_view to_string(Grant grant) noexcept;

/// One request to the system and its result, in words.
struct SetupNote {
  std::string subject;  ///< "thread 'lane-0'", "memory lock".
  Grant grant = Grant::kGranted;
  std::string text;    ///< The result, a clause.
  std::string remedy;  ///< The user's remedy; empty if none is needed.
};

/// The number of subjects that are kept at most; later ones are dropped.
inline constexpr std::size_t kSetupNoteCountMax = 256;

/// The requests of this process to the system so far: threads, memory, CPU latency. Each subject
/// appears once, with its latest result.
/// @threads  any
/// @realtime set-up only
[[nodiscard]] std::vector<SetupNote> setup_report();

/// The notes as lines, each with its remedy below.
/// @realtime set-up only
[[nodiscard]] std::string to_text(const std::vector<SetupNote>& notes);

/// A warning that may be due often: it is printed on standard error at once, and then at most every
/// kInterval, with the number of times that it was due meanwhile.
/// @threads  one. Not for lanes
class RepeatedWarning {
 public:
  static constexpr Duration kInterval = std::chrono::seconds{10};
  /// Prints "rtpm: warning: <text>" if that is due at `now`. Allocates nothing.
  void say(std::string_view text, MonotonicTime now) noexcept;

 private:
  MonotonicTime next_ = MonotonicTime::min();
  std::uint64_t kept_count_ = 0;  ///< How often it was due since it was printed.
};

/// Adds a note to setup_report(), in place of the one with its subject.
/// @threads  any. Set-up only
void note_setup(SetupNote note);

}  // namespace rtpm::rt
