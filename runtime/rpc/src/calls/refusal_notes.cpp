#include "calls/refusal_notes.hpp"

#include <algorithm>
#include <chrono>
#include <cstring>
#include <new>
#include <string>

namespace rtpm::rpc {
namespace {

constexpr Duration kWriteInterval = std::chrono::milliseconds{100};

}  // namespace

void RefusalNotes::note(const Object& object, const wire::Request& request, wire::Status status,
                        std::string_view text) noexcept {
  for (Note& note : notes_) {
    State free = State::kFree;
    if (!note.state.compare_exchange_strong(free, State::kTaken, std::memory_order_acquire)) {
      continue;
    }
    note.object = &object;
    note.method = request.header.method;
    note.caller = {request.caller_host};
    note.status = status;
    note.size = std::min(text.size(), note.text.size());
    if (note.size > 0) std::memcpy(note.text.data(), text.data(), note.size);
    note.state.store(State::kNoted, std::memory_order_release);
    if (count_.fetch_add(1, std::memory_order_acq_rel) == 0) bell_.ring();
    return;
  }
}

MonotonicTime RefusalNotes::write_due(MonotonicTime now) {
  if (count_.load(std::memory_order_acquire) == 0) return kNever;
  if (now < due_) return due_;
  due_ = now + kWriteInterval;
  write();
  return due_;
}

void RefusalNotes::write() {
  for (Note& note : notes_) {
    if (note.state.load(std::memory_order_acquire) != State::kNoted) continue;
    try {
      log_.write(line_of(note));
    } catch (const std::bad_alloc&) {
      // Dropped: the counters still count it.
    }
    note.state.store(State::kFree, std::memory_order_release);
    count_.fetch_sub(1, std::memory_order_acq_rel);
  }
}

std::string RefusalNotes::line_of(const Note& note) {
  const auto methods = note.object->servant->interface().methods;
  const auto found = std::ranges::find(methods, note.method, &MethodDescriptor::id);
  const std::string method =
      found == methods.end() ? std::to_string(note.method) : std::string(found->name);
  const bool has_failed = note.status == wire::Status::kServantFailed;
  const std::string event =
      has_failed ? " failed: it threw" : " refused a request of " + to_string(note.caller) + ":";
  std::string_view text(note.text.data(), note.size);
  if (text.empty()) text = has_failed ? "no text" : "a value is not what the method takes";
  return note.object->path + ": method " + method + event + ' ' + std::string(text);
}

}  // namespace rtpm::rpc
