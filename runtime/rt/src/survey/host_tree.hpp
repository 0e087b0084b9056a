#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace rtpm::rt {

/// The system's files below a root folder, which tests fake.
/// @realtime set-up only
class HostTree {
 public:
  explicit HostTree(std::string root) : root_(std::move(root)) {}

  /// The file's contents, without the final newline; empty if it can't be read. At most 1 MiB.
  [[nodiscard]] std::string text(const std::string& path) const;
  [[nodiscard]] std::optional<std::int64_t> number(const std::string& path) const;
  [[nodiscard]] bool has(const std::string& path) const;
  /// The symbolic link's target; empty if it is not a link.
  [[nodiscard]] std::string link(const std::string& path) const;
  /// The names in the folder that begin with `prefix`, sorted; numbers by value.
  [[nodiscard]] std::vector<std::string> entries(const std::string& path,
                                                 std::string_view prefix = {}) const;
  /// The process ids in /proc.
  [[nodiscard]] std::vector<int> process_ids() const;

 private:
  std::string root_;
};

/// Parses `text` as a number; nullopt if it is not one.
[[nodiscard]] std::optional<std::int64_t> number_of(std::string_view text, int base = 10) noexcept;
/// Splits `text` at white space.
[[nodiscard]] std::vector<std::string> words_of(std::string_view text);
[[nodiscard]] std::vector<std::string> lines_of(std::string_view text);

/// Parses the kernel's CPU list: "0-3,5". Ignores malformed parts.
[[nodiscard]] std::vector<int> parse_cpu_list(std::string_view text);
[[nodiscard]] std::string cpu_list_text(const std::vector<int>& cpus);
/// The union of both, ascending, without duplicates.
[[nodiscard]] std::vector<int> united(const std::vector<int>& a, const std::vector<int>& b);
[[nodiscard]] std::vector<int> common(const std::vector<int>& a, const std::vector<int>& b);
[[nodiscard]] std::vector<int> without(const std::vector<int>& a, const std::vector<int>& b);

}  // namespace rtpm::rt
