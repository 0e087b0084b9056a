#include "waiting/poll_wait_set.hpp"

#include <algorithm>
#include <cerrno>
#include <utility>

#include "os/native_socket.hpp"
#include "rtpm/base/assert.hpp"

namespace rtpm::transport {

PollWaitSet::BlockScope::BlockScope(PollWaitSet& set, MonotonicTime until, WaitLock* held) noexcept
    : set_(set), held_(until == kAlready ? nullptr : held) {
  if (held_ != nullptr) {
    set_.is_blocked_ = true;
    held_->unlock();
  }
  if (until != kAlready) asleep_.emplace();
}

PollWaitSet::BlockScope::~BlockScope() {
  const int error = errno;
  asleep_.reset();
  if (held_ != nullptr) {
    held_->lock();
    set_.is_blocked_ = false;
  }
  errno = error;
}

PollWaitSet::PollWaitSet(std::size_t source_count_max, os::Doorbell doorbell)
    : doorbell_(std::move(doorbell)), source_count_max_(source_count_max) {
  sources_.reserve(source_count_max);
  entries_.reserve(source_count_max + 1);
  tags_.reserve(source_count_max + 1);
}

bool PollWaitSet::has_room_for(int descriptor) const noexcept {
  return sources_.size() < source_count_max_ && os::is_open(descriptor);
}

bool PollWaitSet::add(int descriptor, SourceTag tag, Trigger trigger) noexcept {
  RTPM_ASSERT(tag.kind() != SourceKind::kDoorbell, "the doorbell is the set's own source");
  if (trigger == Trigger::kEdge || !has_room_for(descriptor)) return false;
  if (find(descriptor) != sources_.end()) return false;
  sources_.push_back({descriptor, trigger, tag});
  // A poll in progress does not know the source.
  if (is_blocked_) doorbell_.ring();
  return true;
}

void PollWaitSet::remove(int descriptor) noexcept {
  const auto source = find(descriptor);
  if (source == sources_.end()) return;
  // A poll in progress keeps the file open, so the peer would not see it close.
  if (is_blocked_) doorbell_.ring();
  erase(source);
}

std::vector<PollWaitSet::Source>::iterator PollWaitSet::find(int descriptor) noexcept {
  return std::ranges::find(sources_, descriptor, &Source::descriptor);
}

void PollWaitSet::erase(std::vector<Source>::iterator source) noexcept {
  *source = sources_.back();
  sources_.pop_back();
}

std::size_t PollWaitSet::wait(MonotonicTime until, std::span<SourceTag> ready,
                              WaitLock* held) noexcept {
  RTPM_ASSERT(!ready.empty(), "a wait reports at least one source");
  begin_wait();
  entries_.clear();
  tags_.clear();
  entries_.push_back(os::polled(doorbell_.descriptor()));
  tags_.push_back(kDoorbell);
  for (const Source& source : sources_) {
    entries_.push_back(os::polled(source.descriptor));
    tags_.push_back(source.tag);
  }
  int ready_count = 0;
  {
    const BlockScope scope(*this, until, held);
    ready_count = os::poll_until(entries_, until);
  }
  RTPM_ASSERT(ready_count >= 0 || errno == EINTR, "there is nothing wrong with the descriptors");
  std::size_t count = 0;
  const std::size_t first = next_;
  for (std::size_t i = 0; i < entries_.size() && ready_count > 0 && count < ready.size(); ++i) {
    const std::size_t index = (first + i) % entries_.size();
    if (entries_[index].revents == 0) continue;
    --ready_count;
    if (index == 0 ? has_rung() : is_present(entries_[index], tags_[index])) {
      ready[count++] = tags_[index];
      next_ = index + 1;
    }
  }
  return count;
}

// Whether no other thread has removed the source meanwhile. A descriptor that was closed without
// remove() is dropped, as in epoll.
bool PollWaitSet::is_present(const pollfd& entry, SourceTag tag) noexcept {
  const auto source = find(os::number_of(entry));
  if (source == sources_.end() || source->tag != tag) return false;
  if ((entry.revents & POLLNVAL) == 0) return true;
  erase(source);
  return false;
}

bool PollWaitSet::has_rung() noexcept {
  doorbell_.clear();
  return take_rings();
}

bool PollWaitSet::take_rings() noexcept {
  // SYNC POINT wait-set-rings
  const std::uint64_t count = ring_count_.load(std::memory_order_seq_cst);
  const bool has_some = std::exchange(heard_count_, count) != count;
  if (has_some) was_rung_ = true;
  return has_some;
}

void PollWaitSet::ring() noexcept {
  count_ring();
  doorbell_.ring();
}

}  // namespace rtpm::transport
