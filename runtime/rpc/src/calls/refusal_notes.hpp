#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <string_view>

#include "model/object_table.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/rpc/servant.hpp"
#include "rtpm/rt/log.hpp"
#include "rtpm/transport/wait_set.hpp"
#include "rtpm/wire/server_sessions.hpp"

namespace rtpm::rpc {

/// Why calls were refused or failed, for the server's log. Lanes add notes, the acceptor's thread
/// writes them. At high rates only some are logged; the counters count all.
/// @threads  note(): any, concurrently; the rest one at a time
/// @realtime note() is alloc-free and lock-free, at most one syscall; the rest is set-up only
class RefusalNotes {
 public:
  /// @param bell  wakes the thread that calls write_due()
  explicit RefusalNotes(transport::WaitSet& bell) noexcept : bell_(bell) {}

  /// @param text  as sent to the caller; may be empty
  void note(const Object& object, const wire::Request& request, wire::Status status,
            std::string_view text) noexcept;
  /// Writes the new notes, a few times a second.
  /// @return when to call again; kNever if only after the bell rings
  [[nodiscard]] MonotonicTime write_due(MonotonicTime now);
  /// Writes all pending notes.
  void write();

 private:
  enum class State : std::uint8_t { kFree, kTaken, kNoted };
  struct Note {
    std::atomic<State> state{State::kFree};
    const Object* object = nullptr;
    std::uint16_t method = 0;
    CallerHost caller{};
    wire::Status status{};
    std::size_t size = 0;
    std::array<char, wire::kRefusalTextSizeMax> text{};
  };
  static constexpr std::size_t kNoteCount = 8;

  [[nodiscard]] static std::string line_of(const Note& note);

  transport::WaitSet& bell_;
  std::array<Note, kNoteCount> notes_{};
  std::atomic<std::uint32_t> count_{0};
  MonotonicTime due_{};
  rt::Log log_{"rtpm"};
};

}  // namespace rtpm::rpc
