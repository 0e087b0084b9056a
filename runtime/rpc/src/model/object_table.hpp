#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/rpc/server.hpp"

namespace rtpm::rpc {

/// One object that a server serves.
struct Object {
  std::string path;
  Servant* servant = nullptr;
  ObjectOptions options{};
  std::uint32_t number = 0;          ///< The number that a bind returns, from 1.
  std::vector<Role> method_roles{};  ///< The role that a caller needs, by method number.

  /// The role for a method. A method that the interface lacks requires the default role.
  [[nodiscard]] Role role_for(std::uint16_t method) const noexcept {
    return method < method_roles.size() ? method_roles[method] : Role::kCommand;
  }
};

/// Whether a call of this priority may run on the object.
/// @realtime alloc-free
[[nodiscard]] bool admits(const ObjectOptions& options, Priority priority) noexcept;

/// Decides which objects a caller may know of.
class ObjectView {
 public:
  [[nodiscard]] virtual bool shows(const Object& object) const noexcept = 0;

 protected:
  ObjectView() = default;
  ~ObjectView() = default;
};

/// A server's objects by number and by path. Filled before the server starts and then constant, so
/// that lanes read it without a lock.
/// @realtime alloc-free except add() and paths()
class ObjectTable {
 public:
  static constexpr std::size_t kObjectCountMax = 1024;

  [[nodiscard]] expected<void, SetupError> add(std::string_view path, Servant& servant,
                                               ObjectOptions options, Priority ceiling);
  /// The object with this bind number, or null.
  [[nodiscard]] const Object* find(std::uint32_t service) const noexcept;
  /// The object at that path, or null.
  /// @realtime linear in the objects
  [[nodiscard]] const Object* find(std::string_view path) const noexcept;
  /// The objects' paths, by number from 1.
  [[nodiscard]] std::vector<std::string> paths() const;
  [[nodiscard]] std::size_t size() const noexcept { return objects_.size(); }
  /// Answers a bind (spec/hprotocol.md#hp-6). Objects hidden by `view` do not exist for the caller.
  [[nodiscard]] DispatchResult bind(ConstBytes request, MutableBytes reply,
                                    const ObjectView* view = nullptr) const noexcept;
  /// Answers a describe (spec/hprotocol.md#hp-6.3), with the same rule for `view`.
  [[nodiscard]] DispatchResult describe(ConstBytes request, MutableBytes reply,
                                        const ObjectView* view = nullptr) const noexcept;

 private:
  std::vector<Object> objects_;
};

}  // namespace rtpm::rpc
