#include "rtpm/access/grants.hpp"

#include <algorithm>
#include <tuple>
#include <utility>

namespace rtpm::access {
namespace {

/// An arbitrary order of subjects, for look-ups only.
struct BySubject {
  static auto key(const Subject& subject) noexcept {
    return std::tie(subject.kind, subject.user, subject.key);
  }
  bool operator()(const Grant& one, const Grant& other) const noexcept {
    return key(one.subject) < key(other.subject);
  }
  bool operator()(const Grant& grant, const Subject& subject) const noexcept {
    return key(grant.subject) < key(subject);
  }
  bool operator()(const Subject& subject, const Grant& grant) const noexcept {
    return key(subject) < key(grant.subject);
  }
};

bool is_from(const Grant& grant, const std::optional<NetworkAddress>& address) noexcept {
  if (!address || grant.from.empty()) return true;
  return std::ranges::any_of(grant.from,
                             [&](const AddressRange& range) { return range.contains(*address); });
}

bool covers(const Grant& grant, std::string_view path) noexcept {
  return std::ranges::any_of(grant.objects,
                             [&](const ObjectPattern& object) { return object.covers(path); });
}

// Whether `wide` allows everything that `grant` allows.
bool is_within(const Grant& grant, const Grant& wide) {
  const auto has_object = [&](const ObjectPattern& object) {
    return std::ranges::any_of(wide.objects, [&](const ObjectPattern& each) {
      return each == object || each.text() == "**";
    });
  };
  const auto has_range = [&](const AddressRange& range) {
    return std::ranges::count(wide.from, range) > 0;
  };
  const bool is_from_there =
      wide.from.empty() || (!grant.from.empty() && std::ranges::all_of(grant.from, has_range));
  return wide.subject == grant.subject && wide.role >= grant.role &&
         wide.ceiling >= grant.ceiling && is_from_there &&
         std::ranges::all_of(grant.objects, has_object);
}

}  // namespace

Grants::Grants(std::vector<Grant> grants) : grants_(std::move(grants)) {
  std::stable_sort(grants_.begin(), grants_.end(), BySubject{});
}

template <typename Visit>
void Grants::visit(const Subject& subject, const std::optional<NetworkAddress>& address,
                   Visit visit) const noexcept {
  const auto [first, last] = std::equal_range(grants_.begin(), grants_.end(), subject, BySubject{});
  for (auto grant = first; grant != last; ++grant) {
    if (is_from(*grant, address)) visit(*grant);
  }
}

bool Grants::knows(const Subject& subject,
                   const std::optional<NetworkAddress>& address) const noexcept {
  bool is_known = false;
  visit(subject, address, [&](const Grant&) { is_known = true; });
  return is_known;
}

Permission Grants::permission(const Subject& subject, const std::optional<NetworkAddress>& address,
                              std::string_view path) const noexcept {
  Permission permission;
  visit(subject, address, [&](const Grant& grant) {
    if (!covers(grant, path)) return;
    permission.role = std::max(permission.role, grant.role);
    permission.ceiling = std::max(permission.ceiling, grant.ceiling);
  });
  return permission;
}

Priority Grants::ceiling(const Subject& subject,
                         const std::optional<NetworkAddress>& address) const noexcept {
  Priority ceiling;
  visit(subject, address, [&](const Grant& grant) { ceiling = std::max(ceiling, grant.ceiling); });
  return ceiling;
}

std::string_view Grants::name_of(const Subject& subject) const noexcept {
  std::string_view name;
  visit(subject, std::nullopt, [&](const Grant& grant) {
    if (name.empty()) name = grant.name;
  });
  return name;
}

std::vector<Subject> Grants::narrowed_by(const Grants& after) const {
  std::vector<Subject> narrowed;
  for (const Grant& grant : grants_) {
    if (!narrowed.empty() && narrowed.back() == grant.subject) continue;
    const auto [first, last] =
        std::equal_range(after.grants_.begin(), after.grants_.end(), grant.subject, BySubject{});
    if (std::none_of(first, last, [&](const Grant& wide) { return is_within(grant, wide); })) {
      narrowed.push_back(grant.subject);
    }
  }
  return narrowed;
}

std::string missing_line(const Subject& subject, Role role, std::string_view path) {
  std::string line = to_text(subject);
  line += " role=";
  line += to_string(role);
  line += " on=";
  line += path;
  return line;
}

}  // namespace rtpm::access
