#include "security/audit_log.hpp"

#include <array>
#include <chrono>
#include <cstdio>

#include "rtpm/access/fingerprint.hpp"
#include "rtpm/access/role.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/utc.hpp"
#include "security/access_control.hpp"

namespace rtpm::rpc {
namespace {

using Kind = AuditNote::Kind;
using access::Subject;

// Converts a monotonic time to wall-clock time, as people and other logs use it.
std::string time_text(MonotonicTime time) {
  using namespace std::chrono;
  const sys_time<nanoseconds> wall{nanoseconds{rt::utc_ns(time)}};
  const auto day = floor<days>(wall);
  const year_month_day date{day};
  const hh_mm_ss clock{floor<milliseconds>(wall - day)};
  std::array<char, 64> text{};
  std::snprintf(text.data(), text.size(), "%04d-%02u-%02uT%02d:%02d:%02d.%03dZ",
                static_cast<int>(date.year()), static_cast<unsigned>(date.month()),
                static_cast<unsigned>(date.day()), static_cast<int>(clock.hours().count()),
                static_cast<int>(clock.minutes().count()),
                static_cast<int>(clock.seconds().count()),
                static_cast<int>(clock.subseconds().count()));
  return text.data();
}

std::string_view word_of(Kind kind) noexcept {
  switch (kind) {
    case Kind::kSessionOpened:
      return "opened";
    case Kind::kSessionEnded:
      return "ended";
    case Kind::kSessionRefused:
      return "session-refused";
    case Kind::kBound:
      return "bound";
    case Kind::kRefused:
      return "refused";
    case Kind::kCalled:
      return "called";
    case Kind::kReloaded:
      break;
  }
  return "reloaded";
}

std::string who_text(const Subject& subject) {
  if (subject.kind == Subject::Kind::kKey) return "key:" + access::fingerprint(subject.key);
  return access::to_text(subject);
}

// Formats an IPv6 address, or the IPv4 address mapped in it.
std::string address_text(const access::NetworkAddress& bytes) {
  const auto address = transport::SocketAddress::of_ipv6(bytes, 0, 0);
  const auto unmapped = transport::SocketAddress::of(address.peer());
  return (unmapped.is_ipv4() ? unmapped : address).host();
}

std::string name_text(const AccessControl& control, const CallOrigin& origin) {
  std::array<char, 64> room{};
  return printable(control.name_of(origin, room));
}

}  // namespace

expected<std::unique_ptr<AuditLog>, SetupError> AuditLog::open(const std::string& file,
                                                               const AccessControl& control) {
  std::unique_ptr<AuditLog> log(new AuditLog(control));
  if (file.empty()) return log;
  auto opened = access::LogFile::open(file);
  if (!opened) return setup_error("the audit log", opened.error());
  log->file_.emplace(std::move(*opened));
  return log;
}

AuditLog::AuditLog(const AccessControl& control)
    : control_(control), cells_(std::make_unique<Cell[]>(kNoteCountMax)) {
  for (std::size_t i = 0; i < kNoteCountMax; ++i)
    cells_[i].turn.store(i, std::memory_order_relaxed);
}

AuditLog::~AuditLog() {
  write_notes();
}

void AuditLog::note(const AuditNote& note) noexcept {
  std::uint64_t tail = tail_.load(std::memory_order_relaxed);
  while (true) {
    Cell& cell = cells_[tail % kNoteCountMax];
    // SYNC POINT audit-free: the reader has finished with the cell.
    const auto lead = static_cast<std::int64_t>(cell.turn.load(std::memory_order_acquire) - tail);
    if (lead < 0) {
      lost_count_.fetch_add(1, std::memory_order_relaxed);
      return;
    }
    if (lead > 0) {
      tail = tail_.load(std::memory_order_relaxed);
    } else if (tail_.compare_exchange_weak(tail, tail + 1, std::memory_order_relaxed)) {
      cell.note = note;
      // SYNC POINT audit-filled: the note is complete.
      cell.turn.store(tail + 1, std::memory_order_release);
      return;
    }
  }
}

bool AuditLog::take(AuditNote& note) noexcept {
  Cell& cell = cells_[head_ % kNoteCountMax];
  // SYNC POINT audit-filled
  if (cell.turn.load(std::memory_order_acquire) != head_ + 1) return false;
  note = cell.note;
  // SYNC POINT audit-free
  cell.turn.store(head_ + kNoteCountMax, std::memory_order_release);
  ++head_;
  return true;
}

void AuditLog::write_notes() {
  AuditNote note;
  for (std::size_t i = 0; i < kNoteCountMax && take(note); ++i) {
    const bool is_refusal = note.kind == Kind::kRefused || note.kind == Kind::kSessionRefused;
    if (is_refusal) log_.write(refusal_of(note));
    write_line(line_of(note));
  }
  log_.tick();
  const std::uint64_t lost_count = this->lost_count();
  if (lost_count == told_lost_count_) return;
  const std::string count =
      std::to_string(lost_count - std::exchange(told_lost_count_, lost_count));
  log_.write(count + " notes of the audit log were lost: too many came at once");
  write_line(time_text(rt::now()) + " lost count=" + count);
}

std::string AuditLog::line_of(const AuditNote& note) const {
  std::string line = time_text(note.time);
  const auto add = [&](std::string_view key, std::string_view value) {
    if (value.empty()) return;
    line.append(" ").append(key).append("=").append(value);
  };
  line.append(" ").append(word_of(note.kind));
  if (note.kind == Kind::kReloaded) {
    add("file", printable(control_.file(), kShownWhole));
    return line;
  }
  add("who", who_text(note.origin.subject));
  add("name", name_text(control_, note.origin));
  if (note.origin.address) add("from", address_text(*note.origin.address));
  add("path", printable(note.path()));
  add("method", note.method);
  if (note.role != Role::kNone) add("role", access::to_string(note.role));
  if (note.kind == Kind::kCalled && !note.result) add("result", "later");
  if (note.result) add("result", wire::to_string(*note.result));
  if (note.suppressed_count > 0) add("suppressed", std::to_string(note.suppressed_count));
  return line;
}

// Describes a refusal: what happened, to which caller, why, and the remedy.
std::string AuditLog::refusal_of(const AuditNote& note) const {
  const CallOrigin& origin = note.origin;
  std::string who = who_text(origin.subject);
  if (const std::string name = name_text(control_, origin); !name.empty()) who += " (" + name + ")";
  if (origin.address) who += " at " + address_text(*origin.address);
  const std::string path(note.path());
  const bool is_session = note.kind == Kind::kSessionRefused;
  std::string line = access::missing_line(origin.subject, std::max(note.role, Role::kObserve),
                                          path.empty() ? "**" : path);
  std::string text = "refused: " + who;
  if (is_session) {
    text += " has no grant";
  } else if (note.result == wire::Status::kPriorityNotAllowed) {
    const std::string priority = std::to_string(note.priority.value());
    text += " may not call " + printable(path) + " at priority " + priority;
    line += " max-priority=" + priority;
  } else {
    const bool is_bind = note.method == "bind";
    text += is_bind ? " may not bind " : " may not call " + std::string(note.method) + " of ";
    text += printable(path) + ", which takes role " + std::string(access::to_string(note.role));
  }
  if (note.suppressed_count > 0) {
    text += " (and " + std::to_string(note.suppressed_count) + " more)";
  }
  return text + ". To allow it, add to " + printable(control_.file(), kShownWhole) + ": " + line;
}

void AuditLog::write_line(const std::string& line) {
  if (!file_) return;
  // A line that a full disk rejects is lost; the server continues.
  if (auto written = file_->write_line(line); !written) log_.write(written.error().text());
}

}  // namespace rtpm::rpc
