#pragma once

#include <optional>
#include <string>

#include "database.hpp"
#include "rtpm/names/storage.hpp"

namespace rtpm::file_store {

/// The columns of a row of the table `names`, in order.
inline constexpr const char* kColumns =
    "name, url, interface, owner_id, owner_epoch, revision, change, host, lease_ns, properties, "
    "checksum";
inline constexpr int kColumnCount = 11;

/// Binds the row's texts and numbers as parameters, starting with `first`. `properties` must stay
/// valid until reset().
void bind_row(Statement& statement, const names::StoredName& stored, const std::string& properties);

/// Reads a statement's current row, whose columns start with `first`; nullopt if its checksum is
/// wrong, or its properties are invalid.
[[nodiscard]] std::optional<names::StoredName> read_row(const Statement& statement, int first);

}  // namespace rtpm::file_store
