#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "rtpm/access/log_file.hpp"
#include "rtpm/base/expected.hpp"
#include "rtpm/base/priority.hpp"
#include "rtpm/base/role.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/rt/log.hpp"
#include "rtpm/wire/limits.hpp"
#include "rtpm/wire/status.hpp"
#include "security/call_origin.hpp"

namespace rtpm::rpc {

class AccessControl;

/// An event that a lane or the gatekeeper notes.
struct AuditNote {
  enum class Kind : std::uint8_t {
    kSessionOpened,  ///< A session's first call.
    kSessionEnded,
    kSessionRefused,  ///< No grant applies to the identity, or its priority is too high.
    kBound,
    /// A call or bind that requires `role`, which the caller lacks, or a priority above the
    /// caller's ceiling.
    kRefused,
    kCalled,    ///< A method that requires the role configure or administer.
    kReloaded,  ///< Changed grants are in force.
  };

  AuditNote() = default;
  AuditNote(Kind its_kind, const CallOrigin& its_origin, MonotonicTime its_time) noexcept
      : kind(its_kind), origin(its_origin), time(its_time) {}

  void set_path(std::string_view path) noexcept {
    path_size_ = static_cast<std::uint8_t>(path.copy(path_.data(), path_.size()));
  }
  [[nodiscard]] std::string_view path() const noexcept { return {path_.data(), path_size_}; }

  Kind kind = Kind::kReloaded;
  Role role = Role::kNone;  ///< The required role.
  CallOrigin origin{};
  MonotonicTime time{};
  Priority priority{};
  std::optional<wire::Status> result{};  ///< nullopt if the method answers later.
  std::uint32_t suppressed_count = 0;    ///< Similar notes suppressed since the last one.
  std::string_view method{};             ///< Has static lifetime.

 private:
  std::array<char, wire::kPathSizeMax> path_{};
  std::uint8_t path_size_ = 0;
};

/// Passes `burst` notes at once, then one per interval, and counts the rest.
/// @threads  one
/// @realtime alloc-free
class NoteLimit {
 public:
  NoteLimit(std::uint32_t burst, Duration interval) noexcept
      : interval_(interval), tolerance_(interval * (burst - 1)) {}
  /// The number of notes suppressed since the last one that passed; nullopt if this one is
  /// suppressed.
  [[nodiscard]] std::optional<std::uint32_t> admit(MonotonicTime now) noexcept {
    if (full_at_ > now + tolerance_) {
      ++suppressed_count_;
      return std::nullopt;
    }
    full_at_ = std::max(full_at_, now) + interval_;
    return std::exchange(suppressed_count_, 0);
  }

 private:
  Duration interval_;
  Duration tolerance_;
  MonotonicTime full_at_{};
  std::uint32_t suppressed_count_ = 0;
};

/// The events of a secured server: lanes note them, a time-shared thread writes them. Refusals also
/// go to the server's log, with the line of `authorized` that would allow the refused action.
///
/// A line of the file, which only its owner can read:
///
///     2026-11-25T06:48:08.123Z called who=key:3f2a-91c0-77de-0b14-a5c2 name=alice
///         from=192.168.7.4 path=lab/arm0 method=set_parameter role=configure result=ok
///
/// access::LogFile bounds its size.
/// @threads  note(): any; write_notes(): one at a time
/// @realtime note() is alloc-free and lock-free; the rest is set-up only
class AuditLog {
 public:
  static constexpr std::size_t kNoteCountMax = 1024;  ///< Notes beyond this are lost.

  /// @param file     empty for no file
  /// @param control  must outlive the log
  /// @errors   those of LogFile::open()
  [[nodiscard]] static expected<std::unique_ptr<AuditLog>, SetupError> open(
      const std::string& file, const AccessControl& control);
  AuditLog(const AuditLog&) = delete;
  AuditLog& operator=(const AuditLog&) = delete;
  ~AuditLog();

  void note(const AuditNote& note) noexcept;
  /// Writes the pending notes. Call it a few times a second.
  void write_notes();
  /// The number of notes lost because too many were pending.
  [[nodiscard]] std::uint64_t lost_count() const noexcept {
    return lost_count_.load(std::memory_order_relaxed);
  }

 private:
  explicit AuditLog(const AccessControl& control);
  [[nodiscard]] bool take(AuditNote& note) noexcept;
  [[nodiscard]] std::string line_of(const AuditNote& note) const;
  [[nodiscard]] std::string refusal_of(const AuditNote& note) const;
  void write_line(const std::string& line);

  /// A bounded queue with many writers and one reader; `turn` tells who owns a cell.
  /// @source   Vyukov's bounded MPMC queue
  struct Cell {
    std::atomic<std::uint64_t> turn{0};
    AuditNote note{};
  };
  const AccessControl& control_;
  rt::Log log_{"rtpm"};
  std::optional<access::LogFile> file_{};
  std::unique_ptr<Cell[]> cells_;
  alignas(64) std::atomic<std::uint64_t> tail_{0};
  std::atomic<std::uint64_t> lost_count_{0};
  alignas(64) std::uint64_t head_ = 0;
  std::uint64_t told_lost_count_ = 0;
};

}  // namespace rtpm::rpc
