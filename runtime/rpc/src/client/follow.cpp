#include <algorithm>
#include <mutex>
#include <utility>

#include "client/bind_attempt.hpp"
#include "client/binding_impl.hpp"
#include "client/node_impl.hpp"
#include "client/rebinder.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/rt/clock.hpp"

// How a binding by name follows the name: its calls detect that the server is gone, and the node's
// rebinder resolves the name.
namespace rtpm::rpc {
namespace {

// How long a server may take to answer before the name is resolved again.
constexpr Duration kFollowPatience = std::chrono::seconds{1};

// Whether the server that the name led to may be gone or replaced. Errors of the caller itself (no
// channel, too large) and of a live server (overload) do not indicate that.
bool may_be_gone(CallError error) noexcept {
  switch (error) {
    case CallError::kTimeout:
    case CallError::kDisconnected:
    case CallError::kPeerRestarted:
    case CallError::kUnreachable:
    case CallError::kRefused:
    case CallError::kVersionUnsupported:
    case CallError::kNoSuchMethod:
    case CallError::kNoSuchObject:
    case CallError::kStopped:
    case CallError::kWrongInterface:
      return true;
    default:
      return false;
  }
}

}  // namespace

CallError Binding::Impl::note_failure(CallError error) noexcept {
  if (!follows() || !may_be_gone(error)) return error;
  ask_for_name();
  const int refused = refusal_.load(std::memory_order_relaxed);
  return refused == kNoRefusal ? error : static_cast<CallError>(refused);
}

void Binding::Impl::ask_for_name() noexcept {
  if (!follows() || wants_name_.exchange(true, std::memory_order_acq_rel)) return;
  node_.impl().rebinder().wake();
}

bool Binding::Impl::follow(const std::string& at_url) {
  // The name may lead elsewhere by then, and the system may not report a closed port.
  const Duration patience = std::min(options_.deadline, kFollowPatience);
  auto opened = BindAttempt(node_, interface_, options_, destinations_.get().fingerprint, at_url)
                    .open(deadline_after(patience, rt::now()));
  if (!opened) {
    const std::error_code cause = opened.error().cause;
    // See make_error_code().
    refusal_.store(is_refusal(cause) ? cause.value() - 1 : kNoRefusal, std::memory_order_relaxed);
    const std::lock_guard lock(telling_);
    ++followed_.resolve_count;
    followed_.trouble = "the name '" + printable(name_) + "' leads to " + printable(at_url) + ": " +
                        opened.error().text();
    return false;
  }
  refusal_.store(kNoRefusal, std::memory_order_relaxed);
  const Destination& to = *opened->destination;
  const Destination& from = *destinations_.settled();
  const bool has_moved = to.url != from.url;
  if (!has_moved && &to.endpoint == &from.endpoint && to.door == from.door) {
    opened->bound.destination = &from;
    destinations_.renew(opened->bound);
  } else {
    // No other thread checks that endpoint any more.
    from.endpoint.check_oneways(rt::now());
    destinations_.settle(std::move(opened->destination), opened->bound);
  }
  const std::lock_guard lock(telling_);
  ++followed_.resolve_count;
  if (has_moved) ++followed_.move_count;
  followed_.trouble.clear();
  return true;
}

void Binding::Impl::note_unresolved(std::string text) {
  refusal_.store(kNoRefusal, std::memory_order_relaxed);
  const std::lock_guard lock(telling_);
  ++followed_.resolve_count;
  followed_.trouble = std::move(text);
}

FollowStatus Binding::Impl::follow_status() const {
  const std::lock_guard lock(telling_);
  return followed_;
}

}  // namespace rtpm::rpc
