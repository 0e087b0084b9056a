#include "replica.hpp"

#include <algorithm>
#include <utility>

#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/host.hpp"

namespace rtpm::names {

void Replica::on_changes(std::vector<SharedChange> changes) {
  if (changes.empty()) return;
  const std::uint64_t revision = changes.back().revision;
  {
    const std::lock_guard lock(mutex_);
    store_.apply(std::move(changes), rt::now());
    watches_.wake();
  }
  reach(revision);
}

void Replica::on_restart(std::vector<StoredName> names, std::uint64_t revision, bool is_replaced) {
  {
    const std::lock_guard lock(mutex_);
    store_.apply_all(std::move(names), revision, rt::now());
    // The same revision now means another change, also to a watch that resumes at another registry.
    if (is_replaced) watches_.begin_history(rt::random_u64());
    watches_.wake();
  }
  reach(revision);
}

void Replica::on_current(MonotonicTime as_of) {
  const std::lock_guard lock(mutex_);
  const bool was_stale = store_.stale_for(rt::now()) > Duration{0};
  store_.confirm(as_of);
  if (was_stale) watches_.wake();
}

void Replica::on_trouble(const std::string& sentence) {
  {
    const std::lock_guard lock(progress_mutex_);
    trouble_ = sentence;
    if (!log_.admit(rt::now())) return;
  }
  report_(sentence);
}

// Lower than before after a restart of a storage that was restored.
void Replica::reach(std::uint64_t revision) {
  {
    const std::lock_guard lock(progress_mutex_);
    applied_ = revision;
  }
  progress_.notify_all();
}

bool Replica::wait_for(std::uint64_t revision, MonotonicTime deadline) {
  std::unique_lock lock(progress_mutex_);
  const auto is_here = [&] { return applied_ >= revision; };
  return progress_.wait_for(lock, std::max(deadline - rt::now(), Duration{0}), is_here);
}

std::string Replica::trouble() const {
  const std::lock_guard lock(progress_mutex_);
  return trouble_;
}

}  // namespace rtpm::names
