#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace rtpm::discovery {

/// A name service, as described by the name of its socket in the folder:
/// "registry@192.168.7.2:7420@4711@4026531840@9f8e7d6c", with process id, network namespace and a
/// random number that makes each file name unique.
struct FolderName {
  bool is_registry = false;
  std::string host{};
  std::uint16_t port = 0;
  std::uint32_t process_id = 0;
  std::uint64_t network = 0;

  [[nodiscard]] std::string url() const;
};

[[nodiscard]] std::string to_text(const FolderName& name, std::uint32_t random);
/// @return nullopt if `text` has another form
[[nodiscard]] std::optional<FolderName> parse_folder_name(std::string_view text);

}  // namespace rtpm::discovery
