#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "downloads/download.hpp"
#include "downloads/ticket_table.hpp"
#include "live/callbacks.hpp"
#include "recording/folder.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/exports/export.hpp"
#include "services/call_router.hpp"
#include "work/worker_pool.hpp"

namespace rtpm::console {

/// The services by which clients download recordings, as they are or as tables. Tables are made
/// beside the recordings, in a folder that is removed after the download, and need the memory that
/// exports::export_csv() states.
///
/// - `console/download` {id, file, format, …} answers {path, name, byte_count, late_count, left_out}
///   once the file is made; a format is "mcap" or "csv", and the rest is as TableOptions.
/// - `console/download_progress` {id} answers {part} from 0 to 1.
/// - `console/download_cancel` {id}; a download also ends with its connection.
/// - `console/download_choices` {file} answers what TableOptions can name.
/// @ownership refers to the router
/// @threads  the web server's thread, except stop()
class DownloadDesk {
 public:
  /// Files that are being made, by one connection and by all.
  static constexpr std::size_t kOwnCountMax = 2;
  static constexpr std::size_t kAllCountMax = 8;

  DownloadDesk(std::filesystem::path folder, CallRouter& router, Post post);

  /// Adds the services, removes what an earlier console left, and starts the threads that make
  /// files.
  /// @errors   no thread could be started
  [[nodiscard]] expected<void, SetupError> start();
  /// Ends the making of files. Work that it has posted must not run afterwards.
  void stop();

  /// The download of a ticket, once; nullopt if it is unknown, used or too old.
  [[nodiscard]] std::optional<Download> take(std::string_view ticket, MonotonicTime now);
  /// Drops the tickets that are too old.
  void expire(MonotonicTime now) { tickets_.expire(now); }
  /// Cancels a client's downloads that it has not begun to fetch.
  void on_close(std::uint64_t connection_id);

 private:
  using Json = nlohmann::json;
  /// A file that is being made.
  struct Making {
    std::atomic<bool> is_cancelled{false};
    std::atomic<double> part{0};
  };
  struct Made {
    Download download{};
    exports::Report report{};
  };
  using Key = std::pair<std::uint64_t, std::string>;  ///< The connection, and its id.

  void download(const PendingCall& call, const Json& request);
  void finish(const PendingCall& call, const Key& key, expected<Made, SetupError> made);
  void show_choices(const PendingCall& call, const Json& request);
  [[nodiscard]] expected<Made, SetupError> make_tables(const std::filesystem::path& recording,
                                                       exports::TableOptions options,
                                                       Making& making) const;
  [[nodiscard]] expected<std::shared_ptr<MadeFolder>, SetupError> make_folder() const;
  [[nodiscard]] recording::Progress progress(Making& making, double from, double to) const;

  std::filesystem::path root_;
  RecordingFolder folder_;
  CallRouter& router_;
  Post post_;
  TicketTable tickets_{};
  std::map<Key, std::shared_ptr<Making>> making_{};
  std::atomic<bool> is_ending_{false};
  WorkerPool workers_{};
};

}  // namespace rtpm::console
