#pragma once

#include <memory>
#include <string>

#include "rtpm/names/storage.hpp"

namespace rtpm::file_store {

/// A registry's names in a SQLite database: one transaction per change, with write-ahead logging. A
/// change of a permanent name is on disk when commit() returns. Changes of leased names do not wait
/// for the disk: they survive the end of the program, but not a reboot.
///
/// Opening checks the structure, and each row by its checksum. Damaged content is left out and
/// reported in StoredContent::faults; then every change is refused, so that nothing is overwritten.
/// @param vfs  the SQLite file system to use; empty for the default
/// @ownership locks the database for its lifetime
/// @realtime set-up only
[[nodiscard]] std::unique_ptr<names::Storage> make_file_storage(std::string path,
                                                                std::string vfs = {});

}  // namespace rtpm::file_store
