#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

namespace rtpm::console {

/// A folder for files that are made for one download; removed with the last owner.
class MadeFolder {
 public:
  explicit MadeFolder(std::filesystem::path path) : path_(std::move(path)) {}
  MadeFolder(const MadeFolder&) = delete;
  MadeFolder& operator=(const MadeFolder&) = delete;
  ~MadeFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  [[nodiscard]] const std::filesystem::path& path() const noexcept { return path_; }

 private:
  std::filesystem::path path_;
};

/// A file that a client may fetch once.
struct Download {
  std::filesystem::path path{};
  std::string name{};                  ///< For the browser: letters, digits, '.', '_', '-'.
  std::string media_type{};            ///< "text/csv; charset=utf-8".
  std::shared_ptr<MadeFolder> made{};  ///< Which has the file; nullptr for a recording.
};

/// Has the downloads that clients may fetch.
/// @threads  called on the web server's thread
class DownloadSource {
 public:
  DownloadSource() = default;
  DownloadSource(const DownloadSource&) = delete;
  DownloadSource& operator=(const DownloadSource&) = delete;
  virtual ~DownloadSource() = default;

  /// The download of a ticket, once; nullopt if the ticket is unknown, used or too old.
  [[nodiscard]] virtual std::optional<Download> take_download(std::string_view ticket) = 0;
};

}  // namespace rtpm::console
