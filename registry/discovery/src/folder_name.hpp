#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace rtpm::discovery {

/// What the name of a socket in the folder says of the name service it stands for:
/// "registry@192.168.7.2:7420@4711@4026531840@9f8e7d6c", with the process, the network namespace
/// and a random number, by which no two files have ever the same name.
struct FolderName {
  bool is_registry = false;
  std::string host{};
  std::uint16_t port = 0;
  std::uint32_t process_id = 0;
  std::uint64_t network = 0;

  [[nodiscard]] std::string url() const;
};

[[nodiscard]] std::string to_text(const FolderName& name, std::uint32_t random);
/// @return nullopt: `text` is no such name
[[nodiscard]] std::optional<FolderName> parse_folder_name(std::string_view text);

}  // namespace rtpm::discovery
