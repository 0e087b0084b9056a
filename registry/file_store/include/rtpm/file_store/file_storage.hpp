#pragma once

#include <memory>
#include <string>

#include "rtpm/names/storage.hpp"

namespace rtpm::file_store {

/// A registry's names in a SQLite database: one transaction per change, written ahead. A change of
/// a permanent name has reached the disk when commit() returns. Leased ones are not waited for;
/// they outlast the end of the program, and go with the next start of the machine.
///
/// Opening checks the structure, and each row by a checksum of its own. What is damaged is left out
/// and named in StoredContent::faults; then every change is refused, so that nothing is
/// overwritten.
/// @param vfs  the SQLite file system to use; empty: the system's
/// @ownership locks the database for its lifetime
/// @realtime set-up only
[[nodiscard]] std::unique_ptr<names::Storage> make_file_storage(std::string path,
                                                                std::string vfs = {});

}  // namespace rtpm::file_store
