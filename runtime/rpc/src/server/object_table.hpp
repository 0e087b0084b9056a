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
};

/// A server's objects by number and by path. Filled before the server starts and unchanged from
/// then on, so that lanes read it without a lock.
/// @realtime alloc-free but for add() and paths()
class ObjectTable {
 public:
  static constexpr std::size_t kObjectCountMax = 1024;

  [[nodiscard]] expected<void, SetupError> add(std::string_view path, Servant& servant,
                                               ObjectOptions options, Priority ceiling);
  /// The object that a bind gave this number, or null.
  [[nodiscard]] const Object* find(std::uint32_t service) const noexcept;
  /// By number, the first being 1.
  [[nodiscard]] std::vector<std::string> paths() const;
  /// Answers a bind (spec/hprotocol.md#hp-6).
  [[nodiscard]] DispatchResult bind(ConstBytes request, MutableBytes reply) const noexcept;
  /// Answers a describe (spec/hprotocol.md#hp-6.3).
  [[nodiscard]] DispatchResult describe(ConstBytes request, MutableBytes reply) const noexcept;

 private:
  std::vector<Object> objects_;
};

}  // namespace rtpm::rpc
