#include "local_models.hpp"

namespace rtpm::gvd {

void LocalModels::hold(const HeldList& list) noexcept {
  lease_ = list.lease;
  evaluator_.set(list.list);
}

void LocalModels::take_for(std::uint64_t holder) noexcept {
  if (const auto newest = mailbox_.take()) hold(*newest);
  if (lease_ != holder && !is_empty()) drop();
}

void LocalModels::drop_before_release() noexcept {
  const auto newest = mailbox_.take();
  evaluator_.clear();
  if (newest && newest->is_after_release) hold(*newest);
}

void LocalModels::drop() noexcept {
  static_cast<void>(mailbox_.take());
  evaluator_.clear();
}

}  // namespace rtpm::gvd
