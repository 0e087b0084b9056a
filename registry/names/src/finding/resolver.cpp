#include "rtpm/names/resolver.hpp"

#include <algorithm>
#include <utility>
#include <vector>

#include "rtpm/names/reachable.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/log.hpp"

namespace rtpm::names {

RegistryResolver::RegistryResolver(rpc::Node& node, std::string where)
    : node_(node), directory_(node, std::move(where)) {}

RegistryResolver::~RegistryResolver() {
  node_.forget(*this);
}

expected<std::string, SetupError> RegistryResolver::resolve(std::string_view name,
                                                            MonotonicTime deadline) {
  auto found = directory_.entry_of(name, deadline);
  if (!found) return unexpected{std::move(found.error())};
  watch(name, *found, deadline);
  auto url = reachable_url(*found);
  if (!url) return url;
  return *url + std::string(name.substr(found->name.size()));
}

std::uint64_t RegistryResolver::move_count() const {
  const std::lock_guard lock(mutex_);
  return move_count_;
}

// Watches the name and the names above it: any of them may be bound next.
void RegistryResolver::watch(std::string_view name, const NameEntry& entry,
                             MonotonicTime deadline) {
  std::vector<std::string> names;
  {
    const std::lock_guard lock(mutex_);
    const std::size_t former_count = leads_.size();
    for (std::size_t end = name.find('/');; end = name.find('/', end + 1)) {
      leads_.try_emplace(std::string(name.substr(0, end)));
      if (end == std::string_view::npos) break;
    }
    leads_.insert_or_assign(entry.name, Lead{entry.url, entry.revision});
    if (leads_.size() == former_count) return;
    if (leads_.size() > kWatchedNameCountMax) {
      if (former_count <= kWatchedNameCountMax) {
        rt::print_error("rtpm-names", "more than " + std::to_string(kWatchedNameCountMax) +
                                          " names are in use; from '" + std::string(name) +
                                          "' on, bindings look a name up only when a call fails");
      }
      return;
    }
    for (const auto& [each, lead] : leads_)
      names.push_back(each);
  }
  const std::lock_guard lock(starting_);
  if (watch_) return watch_->set_names(std::move(names));
  const Duration left = std::max(deadline - rt::now(), Duration{0});
  auto started = NameWatch::start(
      node_, directory_.where(),
      {.names = std::move(names), .deadline = std::min<Duration>(left, std::chrono::seconds{1})},
      {.on_change = [this](const NameChange& change) { note(change); }});
  if (started) {
    watch_ = std::move(*started);
    return;
  }
  // The next resolved name tries again.
  const std::lock_guard names_lock(mutex_);
  leads_.clear();
}

void RegistryResolver::note(const NameChange& change) {
  if (change.kind == NameChange::Kind::kGone) return;
  {
    const std::lock_guard lock(mutex_);
    const auto known = leads_.find(change.entry.name);
    const Lead lead{change.entry.url, change.entry.revision};
    if (known == leads_.end() || known->second == lead) return;
    known->second = lead;
    ++move_count_;
  }
  node_.look_again(change.entry.name);
}

}  // namespace rtpm::names
