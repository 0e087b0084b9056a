#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "live/callbacks.hpp"
#include "recording/folder.hpp"
#include "review/review.hpp"
#include "services/call_router.hpp"
#include "work/worker_pool.hpp"

namespace rtpm::console {

/// The services that review recordings, annotate, cut, rename and delete them.
/// @ownership refers to all its arguments
/// @threads  the web server's thread
class ReviewDesk {
 public:
  /// Why a recording must stay as it is; empty if it need not.
  using UseOf = std::function<std::string(const std::string& file)>;

  ReviewDesk(RecordingFolder& folder, UseOf use_of, CallRouter& router, Post post);

  /// Adds the services, and starts threads that read files.
  /// @errors   no thread could be started
  [[nodiscard]] expected<void, SetupError> start();
  /// Stops reading files. Work that it has posted must not run afterwards.
  void stop();

 private:
  using Json = nlohmann::json;
  /// Recordings that are open, each with its overview.
  static constexpr std::size_t kOpenCountMax = 2;

  /// A recording that was opened, or is being opened.
  struct Open {
    std::string file{};
    std::string path{};
    std::uint64_t byte_count = 0;
    std::filesystem::file_time_type time{};
    std::shared_ptr<Review> review{};    ///< nullptr while it is being opened.
    std::vector<PendingCall> waiting{};  ///< Calls that are answered once it is open.
    nlohmann::ordered_json notes{};
    std::string notes_problem{};
    std::string cut_file{};  ///< The part that is being cut; empty if none is.
    std::atomic<bool> is_closed{false};
    std::atomic<double> cut_progress{0};
  };
  using OpenPtr = std::shared_ptr<Open>;

  void add_changes();
  void open(const PendingCall& call, const Json& request);
  void begin(const OpenPtr& opened);
  void answer_open(const PendingCall& call, const OpenPtr& opened);
  void series(const PendingCall& call, const Json& request);
  void cut(const PendingCall& call, const Json& request);
  void annotate(const PendingCall& call, const Json& request);
  /// The open recording of this name; nullptr if there is none, or the file is another one by now.
  [[nodiscard]] OpenPtr find(const std::string& file);
  void close(const std::string& file);
  /// The recording's path if it may be changed; else fails the call.
  [[nodiscard]] std::string changeable(const PendingCall& call, const std::string& file);
  /// Runs `work` on the thread for changes; it returns the answer, or why there is none.
  void run(const PendingCall& call,
           std::function<expected<nlohmann::ordered_json, SetupError>()> work);
  void reply(const PendingCall& call, const expected<nlohmann::ordered_json, SetupError>& done);

  RecordingFolder& folder_;
  UseOf use_of_;
  CallRouter& router_;
  Post post_;
  WorkerPool reading_{};
  std::atomic<bool> is_ending_{false};
  std::list<OpenPtr> open_{};  ///< The last used first.
};

}  // namespace rtpm::console
