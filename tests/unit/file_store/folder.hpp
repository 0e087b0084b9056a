#pragma once

#include <filesystem>
#include <string>

#include "rtpm/names/storage.hpp"

namespace rtpm::file_store {

/// A folder that the destructor removes.
class Folder {
 public:
  Folder() {
    std::string pattern = (std::filesystem::temp_directory_path() / "rtpm-store-XXXXXX").string();
    if (::mkdtemp(pattern.data()) != nullptr) path_ = pattern;
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  ~Folder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  [[nodiscard]] std::string file(const std::string& name = "names.db") const {
    return (path_ / name).string();
  }

 private:
  std::filesystem::path path_{};
};

[[nodiscard]] inline names::StoredName permanent(std::string name, std::uint64_t revision) {
  return {.name = std::move(name),
          .url = "rtpm://10.0.0.1:1/object",
          .interface = "lab.Arm",
          .owner = {7, 1},
          .revision = revision,
          .change = revision,
          .host = 0x7f00'0001,
          .properties = {{"force", 3.5, "newton"},
                         {"text", std::string("it's")},
                         {"axes", names::PropertyList{names::PropertyType::kText, {"x", "y"}}},
                         {"none", names::PropertyList{names::PropertyType::kReal, {}}}}};
}

inline expected<std::uint64_t, names::StorageError> put(names::Storage& storage,
                                                        const names::StoredName& stored) {
  return storage.commit({stored.name, &stored, stored.change, stored.is_permanent()});
}

}  // namespace rtpm::file_store
