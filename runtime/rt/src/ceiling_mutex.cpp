#include "rtpm/rt/ceiling_mutex.hpp"

#include "native_level.hpp"
#include "rtpm/rt/priority.hpp"

namespace rtpm::rt {
namespace {

// Raises the calling thread, before it takes the mutex: else it could be held off with it in hand.
// The level it had, or 0 if it stays as it is.
int raise_to(Priority ceiling) noexcept {
  const int level = native_level();
  if (level == 0 || level >= level_of(ceiling)) return 0;
  return set_native_level(level_of(ceiling)) ? level : 0;
}

void lower_to(int level) noexcept {
  if (level != 0) set_native_level(level);
}

}  // namespace

void CeilingMutex::lock() noexcept {
  const int level = raise_to(ceiling_);
  mutex_.lock();
  level_before_ = level;
}

bool CeilingMutex::try_lock() noexcept {
  const int level = raise_to(ceiling_);
  if (mutex_.try_lock()) {
    level_before_ = level;
    return true;
  }
  lower_to(level);
  return false;
}

bool CeilingMutex::try_lock_until(MonotonicTime deadline) noexcept {
  const int level = raise_to(ceiling_);
  if (mutex_.try_lock_until(deadline)) {
    level_before_ = level;
    return true;
  }
  lower_to(level);
  return false;
}

void CeilingMutex::unlock() noexcept {
  const int level = level_before_;
  level_before_ = 0;
  mutex_.unlock();
  lower_to(level);
}

}  // namespace rtpm::rt
