#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <optional>
#include <vector>

#include "model/object_table.hpp"
#include "rtpm/rt/lazy_memory.hpp"
#include "rtpm/wire/server_sessions.hpp"
#include "security/access_control.hpp"
#include "security/audit_log.hpp"

namespace rtpm::rpc {

class Connections;
class Seals;
struct LaneSetup;

/// A call that may run.
struct Target {
  const Object* object = nullptr;
  /// The caller, valid until the lane takes the next frame; null if the server does not
  /// authenticate callers.
  const CallOrigin* origin = nullptr;
};

/// The rights of a lane's sessions, and of its own program. The rights of a session on an object
/// are looked up at its first call, and again after each change of the grants; all other calls
/// compare numbers.
/// @threads  note_run(), and judge() without sessions: any; the rest: with the lane's Lead
/// @realtime alloc-free except construction and prepare(); a look-up takes a lock with priority
///           inheritance
class LaneRights {
 public:
  /// The sessions over datagrams, streams and shared memory.
  using Sessions = std::array<const wire::ServerSessions*, 3>;

  /// @param seals  null if no session is sealed
  LaneRights(const LaneSetup& setup, const Sessions& sessions, Connections& connections,
             Seals* seals);

  /// Allocates the tables, once all objects are added; false without memory.
  /// @realtime set-up only
  [[nodiscard]] bool prepare();
  /// False if every caller may do everything: then call no other function of this class.
  [[nodiscard]] bool is_asked() const noexcept { return control_ != nullptr; }
  [[nodiscard]] const AccessControl* control() const noexcept { return control_; }

  /// Whether the call may run, and its caller. Notes a refusal.
  /// @param sessions  the request's sessions; null for a call within this program
  /// @errors   kNotAllowed, kPriorityNotAllowed
  [[nodiscard]] expected<const CallOrigin*, wire::Status> judge(
      const wire::Request& request, const Object& object,
      const wire::ServerSessions* sessions) noexcept;

  /// The objects that a session may know of, and its caller.
  class View final : public ObjectView {
   public:
    View(LaneRights& rights, std::size_t row) noexcept : rights_(rights), row_(row) {}
    [[nodiscard]] bool shows(const Object& object) const noexcept override;

   private:
    LaneRights& rights_;
    std::size_t row_;
  };
  [[nodiscard]] View view_of(const wire::Request& request,
                             const wire::ServerSessions& sessions) noexcept {
    return {*this, row_of(request, sessions)};
  }

  /// Notes the result of a bind for the audit log.
  void note_bind(const wire::Request& request, const wire::ServerSessions& sessions,
                 wire::Status status) noexcept;
  /// Notes the result of a method, if its role is audited; nullopt if it answers later.
  void note_run(const Target& target, const wire::Request& request,
                std::optional<wire::Status> status) noexcept;
  /// Records the end of sessions that are gone. Each call checks some sessions, in rotation.
  void sweep() noexcept;

 private:
  /// A cached look-up in one word, from the top: generation, role, ceiling. 0 at first.
  using Entry = std::uint64_t;
  struct Row {
    std::uint64_t session = 0;  ///< 0 if unused.
    CallOrigin origin{};
    NoteLimit refusals{8, std::chrono::seconds{1}};
    NoteLimit binds{16, std::chrono::milliseconds{100}};
  };

  [[nodiscard]] std::size_t row_of(const wire::Request& request,
                                   const wire::ServerSessions& sessions) noexcept;
  [[nodiscard]] CallOrigin origin_of(const wire::ServerSessions& sessions,
                                     const wire::Request& request) noexcept;
  [[nodiscard]] Entry entry_of(std::size_t row, const Object& object) noexcept;
  [[nodiscard]] Entry own_entry_of(const Object& object) noexcept;
  [[nodiscard]] Entry look_up(const CallOrigin& origin, const Object& object) const noexcept;
  void end(Row& row) noexcept;
  [[nodiscard]] std::optional<std::uint32_t> admit_own(MonotonicTime now) noexcept;
  void note_refusal(const CallOrigin& origin, NoteLimit* limit, const wire::Request& request,
                    const Object& object, wire::Status status) noexcept;

  const AccessControl* control_;
  AuditLog* audit_;
  const ObjectTable& objects_;
  const Sessions sessions_;
  Connections& connections_;
  Seals* seals_;
  std::size_t session_count_max_;
  std::size_t object_count_ = 0;
  std::vector<Row> rows_{};  ///< The rows of the sessions of each medium.
  std::size_t next_swept_ = 0;
  rt::LazyMemory entries_{};  ///< One entry for each row and object.
  CallOrigin own_origin_{};
  std::vector<std::atomic<Entry>> own_entries_{};  ///< One entry for each object.
  /// When a refusal of this program's own calls was last noted.
  std::atomic<std::int64_t> own_noted_ns_{0};
};

}  // namespace rtpm::rpc
