#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/access/authorized.hpp"

namespace rtpm::access {

/// A subject's rights on one object.
struct Permission {
  Role role = Role::kNone;
  Priority ceiling{};  ///< The highest priority that any grant allows on the object.
};

/// All grants in force. There are no denials: a subject may do what any of its grants allows. A
/// grant's `from` restricts network callers only; callers on this host always meet it.
/// @ownership immutable; a reload creates a new one
/// @threads  any
class Grants {
 public:
  Grants() = default;
  explicit Grants(std::vector<Grant> grants);

  /// Whether the subject has any grant at that address. A server opens sessions only for such
  /// subjects.
  [[nodiscard]] bool knows(const Subject& subject,
                           const std::optional<NetworkAddress>& address) const noexcept;
  /// The highest role that the subject's grants allow on the object at `path`.
  /// @realtime alloc-free, linear in the subject's grants: at bind, not at each call
  [[nodiscard]] Permission permission(const Subject& subject,
                                      const std::optional<NetworkAddress>& address,
                                      std::string_view path) const noexcept;
  /// The highest priority of any of the subject's grants, for the session as a whole.
  [[nodiscard]] Priority ceiling(const Subject& subject,
                                 const std::optional<NetworkAddress>& address) const noexcept;
  /// The subject's name in its grants; empty if they give none.
  [[nodiscard]] std::string_view name_of(const Subject& subject) const noexcept;
  /// The subjects that have a grant here which allows something that no single grant of `after`
  /// allows. May include subjects whose grants were merely split differently.
  /// @realtime set-up only
  [[nodiscard]] std::vector<Subject> narrowed_by(const Grants& after) const;
  [[nodiscard]] std::size_t size() const noexcept { return grants_.size(); }

 private:
  template <typename Visit>
  void visit(const Subject& subject, const std::optional<NetworkAddress>& address,
             Visit visit) const noexcept;

  std::vector<Grant> grants_{};  // Sorted by subject.
};

/// The line of `authorized` that would allow the request; a refusal in the server's log shows it.
[[nodiscard]] std::string missing_line(const Subject& subject, Role role, std::string_view path);

}  // namespace rtpm::access
