#include "events/source_names.hpp"

#include <utility>

#include "devices/device_names.hpp"
#include "rtpm/gvd/device_event.hpp"

namespace rtpm::tool {
namespace {

/// The most unnamed sources that are looked up.
constexpr std::size_t kUnnamedMax = 10'000;

}  // namespace

SourceNames::SourceNames(Context& context) : context_(context) {
  learn();
}

void SourceNames::care() {
  const bool is_due = [this] {
    const std::lock_guard lock(mutex_);
    return std::exchange(has_new_unnamed_, false);
  }();
  if (is_due) learn();
}

std::string SourceNames::name_of(events::SourceId source) {
  const std::lock_guard lock(mutex_);
  const auto known = names_.find(source);
  if (known != names_.end()) return known->second;
  if (unnamed_.size() < kUnnamedMax && unnamed_.insert(source).second) has_new_unnamed_ = true;
  return {};
}

void SourceNames::learn() {
  const auto names = device_names(context_);
  if (!names) return;
  const std::lock_guard lock(mutex_);
  for (const std::string& name : *names)
    names_.insert_or_assign(gvd::source_of(name), name);
}

}  // namespace rtpm::tool
