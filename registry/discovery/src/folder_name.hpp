#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace rtpm::discovery {

/// The description of a name service in the name of its socket in the folder:
/// "registry@192.168.7.2:7420@4711@4026531840@9f8e7d6c", with the process, the network namespace
/// and a random number, which makes each file name unique.
struct FolderName {
  bool is_registry = false;
  std::string host{};
  std::uint16_t port = 0;
  std::uint32_t process_id = 0;
  std::uint64_t network = 0;

  [[nodiscard]] std::string url() const;
};

[[nodiscard]] std::string to_text(const FolderName& name, std::uint32_t random);
/// @return nullopt if `text` is not such a name
[[nodiscard]] std::optional<FolderName> parse_folder_name(std::string_view text);

}  // namespace rtpm::discovery
