#include "rtpm/rt/budget.hpp"
#include "setup_text.hpp"

namespace rtpm::rt {

RealtimeLimit realtime_limit() noexcept {
  return {};
}

bool is_group_without_realtime() noexcept {
  return false;
}

}  // namespace rtpm::rt
