#include "local_models.hpp"

namespace rtpm::gvd {

void LocalModels::hold(const HeldList& list) noexcept {
  lease_ = list.lease;
  ++revision_;
  evaluator_.set(list.list);
}

void LocalModels::clear() noexcept {
  if (is_empty()) return;
  ++revision_;
  evaluator_.clear();
}

void LocalModels::take_for(std::uint64_t holder) noexcept {
  if (const auto newest = mailbox_.take()) hold(*newest);
  if (lease_ != holder && !is_empty()) drop();
}

void LocalModels::drop_before_release() noexcept {
  const auto newest = mailbox_.take();
  clear();
  if (newest && newest->is_after_release) hold(*newest);
}

void LocalModels::drop() noexcept {
  static_cast<void>(mailbox_.take());
  clear();
}

}  // namespace rtpm::gvd
