#include <algorithm>
#include <mutex>
#include <optional>
#include <utility>

#include "client/binding_impl.hpp"
#include "client/node_impl.hpp"
#include "client/rebinder.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/rt/clock.hpp"

// How a binding by name follows the name: its calls see that the server is gone, and the node's
// rebinder looks where the name leads.
namespace rtpm::rpc {
namespace {

// How long a server may take to answer before the name is looked up again.
constexpr Duration kFollowPatience = std::chrono::seconds{1};

// Whether the server that the name led to may be gone, or another be in its place. Errors of the
// caller's own (no channel, too large) and of a living server (overload) do not show that.
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

bool is_refusal(std::error_code cause) noexcept {
  return cause == CallError::kWrongInterface || cause == CallError::kNoSuchMethod ||
         cause == CallError::kNoSuchObject || cause == CallError::kVersionUnsupported ||
         cause == CallError::kNotAllowed;
}

CallError Binding::Impl::note_failure(CallError error) noexcept {
  if (!follows() || !may_be_gone(error)) return error;
  ask_for_name();
  const int refused = refusal.load(std::memory_order_relaxed);
  return refused == kNoRefusal ? error : static_cast<CallError>(refused);
}

void Binding::Impl::ask_for_name() noexcept {
  if (!follows() || asks_for_name.exchange(true, std::memory_order_acq_rel)) return;
  node.impl().rebinder().wake();
}

bool Binding::Impl::follow(const std::string& at_url) {
  // The name may lead elsewhere by then, and the system may not tell that the port is closed.
  const Duration patience = std::min(bind_options.deadline, kFollowPatience);
  auto opened = open(at_url, deadline_after(patience, rt::now()));
  if (!opened) {
    const std::error_code cause = opened.error().cause;
    refusal.store(is_refusal(cause) ? cause.value() : kNoRefusal, std::memory_order_relaxed);
    const std::lock_guard lock(telling);
    ++followed.resolve_count;
    followed.trouble = "the name '" + printable(name) + "' leads to " + printable(at_url) + ": " +
                       opened.error().text();
    return false;
  }
  refusal.store(kNoRefusal, std::memory_order_relaxed);
  const Destination& to = *opened->destination;
  const bool is_same =
      to.url == settled->url && &to.endpoint == &settled->endpoint && to.door == settled->door;
  if (is_same) {
    opened->bound.destination = settled.get();
    remember(opened->bound);
  }
  const bool has_moved = to.url != settled->url;
  if (!is_same) {
    // No other thread looks there any more.
    settled->endpoint.check_oneways(rt::now());
    settle(std::move(*opened));
  }
  const std::lock_guard lock(telling);
  ++followed.resolve_count;
  if (has_moved) ++followed.move_count;
  followed.trouble.clear();
  return true;
}

void Binding::Impl::note_unresolved(std::string text) {
  refusal.store(kNoRefusal, std::memory_order_relaxed);
  const std::lock_guard lock(telling);
  ++followed.resolve_count;
  followed.trouble = std::move(text);
}

bool Binding::Impl::free_former() noexcept {
  if (former.empty()) return true;
  // SYNC POINT binding-destinations: a pin that comes later than this look sees the newest.
  if (pin_count.fetch_add(0, std::memory_order_acq_rel) > 0) return false;
  former.clear();
  return true;
}

}  // namespace rtpm::rpc
