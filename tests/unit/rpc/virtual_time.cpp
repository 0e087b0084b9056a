#include "virtual_time.hpp"

#include <algorithm>
#include <map>
#include <mutex>
#include <utility>

#include "rtpm/base/assert.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/memory.hpp"

namespace rtpm::rpc::test {
namespace {

struct State {
  std::recursive_mutex mutex{};  ///< Taken by the lane's thread and the thread that starts it.
  MonotonicTime time{};
  Duration look{};
  std::multimap<MonotonicTime, std::function<void()>> events{};
  bool is_in_event = false;
};

State& state() {
  static State the_state;
  return the_state;
}

// Advances the time to `when`, and runs the events that are due on the way.
void move_to(MonotonicTime when) {
  State& s = state();
  const std::lock_guard lock(s.mutex);
  while (!s.is_in_event && !s.events.empty() && s.events.begin()->first <= when) {
    const rt::AllowAllocationScope is_allowed;
    auto due = s.events.extract(s.events.begin());
    s.time = std::max(s.time, due.key());
    s.is_in_event = true;
    due.mapped()();
    s.is_in_event = false;
  }
  s.time = std::max(s.time, when);
}

}  // namespace

void VirtualTime::start(Duration look) {
  State& s = state();
  s.time = MonotonicTime{std::chrono::seconds{1000}};
  s.look = look;
  s.events.clear();
}

void VirtualTime::at(MonotonicTime when, std::function<void()> event) {
  state().events.emplace(when, std::move(event));
}

void VirtualTime::sleep(MonotonicTime until, const std::function<bool()>& is_woken) {
  while (!is_woken() && state().time < until) {
    const bool has_event = !state().events.empty() && state().events.begin()->first < until;
    RTPM_ASSERT(has_event || until != kNever, "nothing would ever wake the lane");
    move_to(has_event ? state().events.begin()->first : until);
  }
}

}  // namespace rtpm::rpc::test

// Replaces the library's functions.
namespace rtpm::rt {

MonotonicTime now() noexcept {
  rpc::test::State& s = rpc::test::state();
  const std::lock_guard lock(s.mutex);
  rpc::test::move_to(s.time + s.look);
  return s.time;
}

void sleep_until(MonotonicTime time) noexcept {
  rpc::test::move_to(time);
}

}  // namespace rtpm::rt
