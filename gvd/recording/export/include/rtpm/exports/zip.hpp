#pragma once

#include <string>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/recording/file_reader.hpp"

namespace rtpm::exports {

/// Writes all files of `folder`, and of the folders in it, compressed into a new ZIP file. Removes
/// each file when it is in the ZIP file, so that both together need little space.
/// @param progress  bytes of the files, done and in all
/// @errors   a file can't be read or written, such as for lack of space; stopped. The ZIP file is
///           then removed
/// @realtime never
/// @source   PKWARE APPNOTE.TXT 6.3.10, with ZIP64 for large files
[[nodiscard]] expected<void, SetupError> zip_folder(const std::string& folder,
                                                    const std::string& path,
                                                    const recording::Progress& progress = {});

}  // namespace rtpm::exports
