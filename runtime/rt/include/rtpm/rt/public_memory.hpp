#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/setup_error.hpp"

namespace rtpm::rt {

/// Memory of this process that other processes of the same user, and root, can find by name and
/// read without its cooperation: it need not answer, or even run. It is an anonymous file that only
/// this process holds, so nothing remains after the process ends in any way.
/// @ownership unmaps on destruction; readers keep their mappings
/// @threads  like any memory
class PublicMemory {
 public:
  PublicMemory() noexcept = default;
  /// Creates zeros, aligned to a page, resident. No other process can write there or change the
  /// size. `name` consists of letters, digits and '-', and is the same for all memory of one kind.
  /// @realtime set-up only
  /// @errors   no descriptor or memory left: a sentence with the remedy
  [[nodiscard]] static expected<PublicMemory, SetupError> create(std::string_view name,
                                                                 std::size_t size);
  PublicMemory(PublicMemory&& other) noexcept;
  PublicMemory& operator=(PublicMemory&& other) noexcept;
  ~PublicMemory();
  [[nodiscard]] MutableBytes bytes() const noexcept { return bytes_; }

 private:
  int file_ = -1;
  MutableBytes bytes_{};
};

/// A reader's view of another process's public memory. That process may be of any version, or
/// hostile: the contents may change at any time, but stay readable.
/// @ownership unmaps on destruction
class PublicView {
 public:
  PublicView(PublicView&& other) noexcept;
  PublicView& operator=(PublicView&& other) noexcept;
  ~PublicView();
  [[nodiscard]] ConstBytes bytes() const noexcept { return bytes_; }
  /// The id of the process.
  [[nodiscard]] int process_id() const noexcept { return process_id_; }
  /// False once the process has ended.
  [[nodiscard]] bool is_alive() const noexcept;

 private:
  friend std::vector<PublicView> find_public_memory(std::string_view name, std::size_t size_max);
  PublicView(int process_id, int process_folder, ConstBytes bytes) noexcept
      : process_id_(process_id), process_folder_(process_folder), bytes_(bytes) {}

  int process_id_;
  int process_folder_;  ///< Kept open, as process ids are reused.
  ConstBytes bytes_;
};

/// Finds all memory with that name that the caller may read, once each, ordered by process id.
/// Leaves out memory that its owner could shrink, or that is larger than `size_max`.
/// @realtime set-up only
[[nodiscard]] std::vector<PublicView> find_public_memory(std::string_view name,
                                                         std::size_t size_max);

}  // namespace rtpm::rt
