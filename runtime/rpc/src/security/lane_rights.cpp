#include "security/lane_rights.hpp"

#include <algorithm>
#include <cstring>
#include <span>

#include "model/connections.hpp"
#include "model/lane_setup.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/wire/control.hpp"
#include "security/seals.hpp"

namespace rtpm::rpc {
namespace {

using access::Permission;

// Tables of the usual size are pre-faulted, so that a session's first call does not page-fault.
constexpr std::size_t kTouchedSizeMax = 1024 * 1024;
// The shortest interval between noted refusals of this program's own calls.
constexpr Duration kOwnNoteInterval = std::chrono::milliseconds{100};
// How many sessions a sweep checks: a few µs.
constexpr std::size_t kSweepCount = 256;

std::uint64_t pack(std::uint32_t generation, const Permission& permission) noexcept {
  return std::uint64_t{generation} << 32 |
         std::uint64_t{static_cast<std::uint8_t>(permission.role)} << 16 |
         static_cast<std::uint16_t>(permission.ceiling.value());
}
std::uint32_t generation_of(std::uint64_t entry) noexcept {
  return static_cast<std::uint32_t>(entry >> 32);
}
Role role_of(std::uint64_t entry) noexcept {
  return static_cast<Role>(static_cast<std::uint8_t>(entry >> 16));
}
int ceiling_of(std::uint64_t entry) noexcept {
  return static_cast<std::uint16_t>(entry);
}

std::string_view method_name(const Object& object, std::uint16_t method) noexcept {
  for (const MethodDescriptor& each : object.servant->interface().methods) {
    if (each.id == method) return each.name;
  }
  return {};
}

AuditNote note_of(AuditNote::Kind kind, const CallOrigin& origin, const wire::Request& request,
                  const Object& object) noexcept {
  AuditNote note(kind, origin, request.received);
  note.set_path(object.path);
  note.method = method_name(object, request.header.method);
  note.role = object.role_for(request.header.method);
  note.priority = request.header.priority;
  return note;
}

}  // namespace

LaneRights::LaneRights(const LaneSetup& setup, const Sessions& sessions, Connections& connections,
                       Seals* seals)
    : control_(setup.access),
      audit_(setup.audit),
      objects_(*setup.objects),
      sessions_(sessions),
      connections_(connections),
      seals_(seals),
      session_count_max_(setup.server->session_count_max) {
  own_origin_.subject.kind = access::Subject::Kind::kLocalUser;
  own_origin_.subject.user = access::this_user();
}

bool LaneRights::prepare() {
  if (!is_asked()) return true;
  object_count_ = objects_.size();
  rows_ = std::vector<Row>(sessions_.size() * session_count_max_);
  own_entries_ = std::vector<std::atomic<Entry>>(object_count_);
  const std::size_t size = rows_.size() * object_count_ * sizeof(Entry);
  entries_ = rt::LazyMemory(size);
  const MutableBytes bytes = entries_.bytes();
  if (bytes.size() != size) return false;
  if (size != 0) std::memset(bytes.data(), 0, std::min(size, kTouchedSizeMax));
  return true;
}

// hp-6.4-1
expected<const CallOrigin*, wire::Status> LaneRights::judge(
    const wire::Request& request, const Object& object,
    const wire::ServerSessions* sessions) noexcept {
  Row* const row = sessions == nullptr ? nullptr : &rows_[row_of(request, *sessions)];
  const CallOrigin& origin = row == nullptr ? own_origin_ : row->origin;
  const Entry entry = row == nullptr
                          ? own_entry_of(object)
                          : entry_of(static_cast<std::size_t>(row - rows_.data()), object);
  wire::Status status = wire::Status::kOk;
  if (request.header.priority.value() > ceiling_of(entry)) {
    status = wire::Status::kPriorityNotAllowed;
  }
  if (role_of(entry) < object.role_for(request.header.method)) status = wire::Status::kNotAllowed;
  if (status == wire::Status::kOk) [[likely]]
    return &origin;
  note_refusal(origin, row == nullptr ? nullptr : &row->refusals, request, object, status);
  return unexpected{status};
}

bool LaneRights::View::shows(const Object& object) const noexcept {
  return role_of(rights_.entry_of(row_, object)) != Role::kNone;
}

// The row of the request's session; reset if another session used the slot before.
std::size_t LaneRights::row_of(const wire::Request& request,
                               const wire::ServerSessions& sessions) noexcept {
  const auto medium = std::ranges::find(sessions_, &sessions) - sessions_.begin();
  const std::size_t index =
      static_cast<std::size_t>(medium) * session_count_max_ + request.session_index;
  Row& row = rows_[index];
  if (row.session == request.header.session) return index;
  sweep();
  end(row);
  row = {.session = request.header.session, .origin = origin_of(sessions, request)};
  const std::size_t row_size = object_count_ * sizeof(Entry);
  if (row_size != 0) std::memset(entries_.bytes().data() + index * row_size, 0, row_size);
  audit_->note({AuditNote::Kind::kSessionOpened, row.origin, request.received});
  return index;
}

// The caller, as authenticated: by the kernel for shared memory, by its key in a sealed session,
// otherwise anonymous.
CallOrigin LaneRights::origin_of(const wire::ServerSessions& sessions,
                                 const wire::Request& request) noexcept {
  const auto peer = sessions.peer_of(request);
  // The address of an unknown peer is ::, which no range contains.
  if (!peer) return origin_of_user(std::nullopt);
  if (&sessions == sessions_[2]) {
    const Slot* const slot = connections_.of_peer(*peer);
    return origin_of_user(slot == nullptr ? std::nullopt : slot->user);
  }
  if (seals_ == nullptr) return origin_at(nullptr, *peer);
  sealed::SealedServer& seals = &sessions == sessions_[1] ? seals_->streams() : seals_->datagrams();
  const auto client = seals.client_of(request.header.session);
  return origin_at(client ? &*client : nullptr, *peer);
}

void LaneRights::end(Row& row) noexcept {
  if (row.session == 0) return;
  audit_->note({AuditNote::Kind::kSessionEnded, row.origin, rt::now()});
  row.session = 0;
}

void LaneRights::sweep() noexcept {
  for (std::size_t i = 0; i < std::min(kSweepCount, rows_.size()); ++i) {
    next_swept_ = (next_swept_ + 1) % rows_.size();
    Row& row = rows_[next_swept_];
    if (row.session == 0) continue;
    if (!sessions_[next_swept_ / session_count_max_]->is_known(row.session)) end(row);
  }
}

LaneRights::Entry LaneRights::entry_of(std::size_t row, const Object& object) noexcept {
  const std::size_t at = (row * object_count_ + object.number - 1) * sizeof(Entry);
  Entry& entry = *reinterpret_cast<Entry*>(entries_.bytes().data() + at);
  if (generation_of(entry) != control_->generation()) [[unlikely]] {
    entry = look_up(rows_[row].origin, object);
  }
  return entry;
}

LaneRights::Entry LaneRights::own_entry_of(const Object& object) noexcept {
  std::atomic<Entry>& kept = own_entries_[object.number - 1];
  Entry entry = kept.load(std::memory_order_relaxed);
  if (generation_of(entry) != control_->generation()) [[unlikely]] {
    entry = look_up(own_origin_, object);
    kept.store(entry, std::memory_order_relaxed);
  }
  return entry;
}

// Reads the generation first: grants that change meanwhile are looked up again.
LaneRights::Entry LaneRights::look_up(const CallOrigin& origin,
                                      const Object& object) const noexcept {
  const std::uint32_t generation = control_->generation();
  Permission permission = control_->permission(origin, object.path);
  if (object.options.checks_callers && control_->knows(origin)) {
    permission.role = std::max(permission.role, Role::kObserve);
    permission.ceiling = std::max(permission.ceiling, control_->ceiling(origin));
  }
  return pack(generation, permission);
}

// Like NoteLimit::admit(), for threads without the lead.
std::optional<std::uint32_t> LaneRights::admit_own(MonotonicTime now) noexcept {
  std::int64_t before = own_noted_ns_.load(std::memory_order_relaxed);
  const std::int64_t now_ns = now.time_since_epoch().count();
  if (now_ns - before < Duration(kOwnNoteInterval).count()) return std::nullopt;
  if (!own_noted_ns_.compare_exchange_strong(before, now_ns, std::memory_order_relaxed)) return {};
  return 0;
}

void LaneRights::note_refusal(const CallOrigin& origin, NoteLimit* limit,
                              const wire::Request& request, const Object& object,
                              wire::Status status) noexcept {
  const auto suppressed =
      limit == nullptr ? admit_own(request.received) : limit->admit(request.received);
  if (!suppressed) return;
  AuditNote note = note_of(AuditNote::Kind::kRefused, origin, request, object);
  note.result = status;
  note.suppressed_count = *suppressed;
  audit_->note(note);
}

void LaneRights::note_bind(const wire::Request& request, const wire::ServerSessions& sessions,
                           wire::Status status) noexcept {
  Row& row = rows_[row_of(request, sessions)];
  const auto wanted = wire::decode_bind_request(request.payload);
  // The object exists but was hidden: the caller is not told, but the server's log is.
  const bool is_refused =
      wanted && status == wire::Status::kNoSuchObject && objects_.find(wanted->path) != nullptr;
  const auto suppressed = (is_refused ? row.refusals : row.binds).admit(request.received);
  if (!suppressed) return;
  AuditNote note(is_refused ? AuditNote::Kind::kRefused : AuditNote::Kind::kBound, row.origin,
                 request.received);
  if (wanted) note.set_path(wanted->path);
  if (is_refused) {
    note.method = "bind";
    note.role = Role::kObserve;
  }
  note.result = status;
  note.suppressed_count = *suppressed;
  audit_->note(note);
}

void LaneRights::note_run(const Target& target, const wire::Request& request,
                          std::optional<wire::Status> status) noexcept {
  if (target.object->role_for(request.header.method) < Role::kConfigure) return;
  AuditNote note = note_of(AuditNote::Kind::kCalled, *target.origin, request, *target.object);
  note.result = status;
  audit_->note(note);
}

}  // namespace rtpm::rpc
