#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "rtpm/base/time.hpp"
#include "rtpm/wire/status.hpp"

namespace rtpm::sim {

inline constexpr std::uint64_t kServerClock = 0xc10c;

/// The outcome that a caller was given at the end of its call.
enum class Outcome : std::uint8_t {
  kOpen,        ///< No outcome yet.
  kDone,        ///< It ran, and its result arrived.
  kNotRun,      ///< It did not run and never will.
  kMayHaveRun,  ///< It may have run or not.
  kReceived,    ///< The server has it and was about to run it.
  kSent,        ///< A oneway without confirmation.
};

/// All events, checked against the protocol's promises: a call runs at most once, a reply answers
/// its own call, "not run" means not run, and no call starts after its deadline.
class History {
 public:
  using Token = std::uint64_t;

  explicit History(bool is_told) : is_told_(is_told) {}

  /// A caller begins a call, which must not run twice unless it is idempotent, or start after
  /// `deadline`.
  [[nodiscard]] Token begin(MonotonicTime now, std::uint32_t client, bool is_idempotent,
                            MonotonicTime deadline);
  /// The servant runs the call; returns how often it has.
  /// @param tolerance  how late the call may start; nullopt if the server can't know the deadline
  std::uint32_t run(MonotonicTime now, Token token,
                    std::optional<Duration> tolerance = std::chrono::microseconds{1});
  /// The call's reply has arrived and states that it answers `replied`, run for the `run_number`th
  /// time.
  void reply(MonotonicTime now, Token token, Token replied, std::uint32_t run_number);
  /// The servant writes one more item to the stream; returns its number.
  std::uint32_t give_item(Token token);
  /// The stream ended in order, after this many items.
  void end_stream(MonotonicTime now, Token token, std::uint32_t item_count);
  void end(MonotonicTime now, Token token, Outcome outcome, std::string_view why);
  /// The call broke a promise, which its caller or its servant detected itself.
  void broken(MonotonicTime now, Token token, const std::string& what) { fault(now, token, what); }
  /// A promise that does not concern a single call was broken.
  void broken(MonotonicTime now, const std::string& what);
  /// Records another event.
  void note(MonotonicTime now, const std::string& what);
  /// Makes the checks that are possible only at the end.
  void finish();

  [[nodiscard]] const std::vector<std::string>& faults() const noexcept { return faults_; }
  [[nodiscard]] std::uint64_t count(Outcome outcome) const;
  /// Equal for equal histories.
  [[nodiscard]] std::uint64_t hash() const noexcept { return hash_; }

 private:
  struct Call {
    bool is_idempotent = false;
    MonotonicTime deadline{};
    Outcome outcome = Outcome::kOpen;
    std::uint32_t run_count = 0;
    std::uint32_t item_count = 0;
  };
  void fault(MonotonicTime now, Token token, const std::string& what);

  bool is_told_;
  std::map<Token, Call> calls_;
  std::vector<std::string> faults_;
  std::uint64_t hash_ = 0;
};

}  // namespace rtpm::sim
