#pragma once

#include <optional>
#include <string>

#include "database.hpp"
#include "rtpm/names/storage.hpp"

namespace rtpm::file_store {

/// What a row of the table `names` holds, in the order of its columns.
inline constexpr const char* kColumns =
    "name, url, interface, owner_id, owner_epoch, revision, change, host, lease_ns, properties, "
    "checksum";
inline constexpr int kColumnCount = 11;

/// The row's texts and numbers, as parameters from `first` on. `properties` must stay until
/// reset().
void bind_row(Statement& statement, const names::StoredName& stored, const std::string& properties);

/// The row that a statement stands at, whose columns begin with `first`; nullopt: its checksum says
/// that it was changed, or it has no valid properties.
[[nodiscard]] std::optional<names::StoredName> read_row(const Statement& statement, int first);

}  // namespace rtpm::file_store
