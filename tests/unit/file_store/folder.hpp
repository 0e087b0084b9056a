#pragma once

#include <string>

#include "rtpm/names/storage.hpp"
#include "rtpm/test/temporary_folder.hpp"
#include "rtpm/test/text.hpp"

namespace rtpm::file_store {

/// A temporary folder for a database.
struct Folder : test::TemporaryFolder {
  [[nodiscard]] std::string file(const std::string& name = "names.db") const {
    return TemporaryFolder::file(name);
  }
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
