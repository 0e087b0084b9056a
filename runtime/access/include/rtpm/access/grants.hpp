#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/access/authorized.hpp"

namespace rtpm::access {

/// A subject's rights to one object.
struct Permission {
  Role role = Role::kNone;
  Priority ceiling{};  ///< The highest priority of any grant for the object.
};

/// All grants in force. There are no denials: a subject may do what any of its grants allows.
/// `from` of a grant is about the network; on this host it is always met.
/// @ownership immutable; a reload makes a new one
/// @threads  any
class Grants {
 public:
  Grants() = default;
  explicit Grants(std::vector<Grant> grants);

  /// Whether the subject has any grant at that address: only then does a server open a session.
  [[nodiscard]] bool knows(const Subject& subject,
                           const std::optional<NetworkAddress>& address) const noexcept;
  /// The greatest role that its grants allow for the object at `path`.
  /// @realtime alloc-free, linear in the subject's grants: at bind, not at each call
  [[nodiscard]] Permission permission(const Subject& subject,
                                      const std::optional<NetworkAddress>& address,
                                      std::string_view path) const noexcept;
  /// The highest priority of any of its grants, for the session as a whole.
  [[nodiscard]] Priority ceiling(const Subject& subject,
                                 const std::optional<NetworkAddress>& address) const noexcept;
  /// The name that its grants give it; empty if they give none.
  [[nodiscard]] std::string_view name_of(const Subject& subject) const noexcept;
  /// The subjects for which a grant of these allows something that no single grant of `after` does.
  /// A subject whose grants were only divided differently may be among them.
  /// @realtime set-up only
  [[nodiscard]] std::vector<Subject> narrowed_by(const Grants& after) const;
  [[nodiscard]] std::size_t size() const noexcept { return grants_.size(); }

 private:
  template <typename Visit>
  void visit(const Subject& subject, const std::optional<NetworkAddress>& address,
             Visit visit) const noexcept;

  std::vector<Grant> grants_{};  // By subject.
};

/// The line of `authorized` that would allow the request, for a refusal in the server's log.
[[nodiscard]] std::string missing_line(const Subject& subject, Role role, std::string_view path);

}  // namespace rtpm::access
