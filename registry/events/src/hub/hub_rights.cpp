#include "hub/hub_rights.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <optional>
#include <string_view>

#include "rtpm/events/defaults.hpp"

namespace rtpm::events {
namespace {

constexpr std::uint32_t kWholeMask = 0xffff'ffff;

/// "rtpm/events/TYPE", "rtpm/events/TYPE/SOURCE".
class EventPath {
 public:
  explicit EventPath(EventType type) noexcept {
    end_ = std::ranges::copy(kHubPath, text_.data()).out;
    append(type);
  }
  void append(std::uint32_t number) noexcept {
    *end_++ = '/';
    end_ = std::to_chars(end_, text_.data() + text_.size(), number).ptr;
  }
  [[nodiscard]] std::string_view text() const noexcept {
    return {text_.data(), static_cast<std::size_t>(end_ - text_.data())};
  }

 private:
  std::array<char, kHubPath.size() + 2 * 11> text_{};
  char* end_ = nullptr;
};

bool has_role(const rpc::Caller& caller, Role role, EventType type,
              std::optional<SourceId> source) noexcept {
  EventPath path(type);
  if (caller.role_on(path.text()) >= role) return true;
  if (!source) return false;
  path.append(*source);
  return caller.role_on(path.text()) >= role;
}

}  // namespace

bool may_use_all(const rpc::Caller* caller, Role role) noexcept {
  return caller == nullptr || caller->role_on(kHubPath) >= role;
}

bool may_use_type(const rpc::Caller* caller, Role role, EventType type) noexcept {
  return may_use_all(caller, role) || has_role(*caller, role, type, std::nullopt);
}

bool may_push(const rpc::Caller* caller, ConstBytes events) noexcept {
  if (may_use_all(caller, Role::kCommand)) return true;
  EventReader reader(events);
  // The lane that handles the events counts and drops malformed ones.
  while (const auto event = reader.next()) {
    if (!has_role(*caller, Role::kCommand, event->header.type, event->header.source)) return false;
  }
  return true;
}

bool may_receive(const rpc::Caller* caller, std::span<const Match> interest) noexcept {
  if (may_use_all(caller, Role::kObserve)) return true;
  return std::ranges::all_of(interest, [&](const Match& match) {
    if (match.type_mask != kWholeMask) return false;
    const bool has_source = match.source_mask == kWholeMask;
    return has_role(*caller, Role::kObserve, match.type,
                    has_source ? std::optional(match.source) : std::nullopt);
  });
}

}  // namespace rtpm::events
