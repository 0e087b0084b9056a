#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace rtpm::access {

/// The objects that a grant covers: a path in which a component may be `*`, which matches any one
/// component, or `**`, which matches any number of components, including none.
class ObjectPattern {
 public:
  /// Parses a pattern. nullopt if `text` is not a path with `*` and `**` as whole components.
  [[nodiscard]] static std::optional<ObjectPattern> parse(std::string_view text);

  /// @param path  the path of an object, "lab/arm0"
  /// @realtime alloc-free; at most the product of both component counts
  [[nodiscard]] bool covers(std::string_view path) const noexcept;
  [[nodiscard]] const std::string& text() const noexcept { return text_; }

  friend bool operator==(const ObjectPattern&, const ObjectPattern&) = default;

 private:
  explicit ObjectPattern(std::string_view text) : text_(text) {}

  std::string text_;
};

}  // namespace rtpm::access
