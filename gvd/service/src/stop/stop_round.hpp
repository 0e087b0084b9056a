#pragma once

#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "rtpm/gvd/stop_delivery.hpp"
#include "rtpm/names/every_service.hpp"
#include "rtpm/rt/parallel_jobs.hpp"
#include "rtpm/rt/pi_mutex.hpp"

namespace rtpm::gvd {

/// Configures a StopRound.
struct StopRoundConfig {
  std::string where{};
  std::string hub{};
  MonotonicTime begin{};
  MonotonicTime deadline{};
  bool tells_hubs = false;
  /// Returns the target of a binding if it should be stopped. Called from several threads.
  std::function<std::optional<StopTarget>(const names::NameEntry&)> choose{};
  std::function<StopScope(const std::string& device)> scope_of{};
};

/// One attempt to stop devices at all their servers concurrently.
/// @ownership refers to its node
/// @threads  one
class StopRound {
 public:
  struct Tried {
    bool is_stopped = false;
    std::string why{};
    bool is_listed = false;  ///< A name service lists it now, as bound or lost.
    bool is_absent = false;  ///< No listener, or another program, is at its address.
  };

  StopRound(rpc::Node& node, StopRoundConfig config);
  /// Adds a target, which may no longer be bound, and tries it at once.
  void add(const StopTarget& target);
  /// Searches name services for further targets, and waits for all attempts to end.
  void run();

  [[nodiscard]] const std::map<StopTarget, Tried>& tried() const noexcept { return tried_; }
  /// The report without the devices.
  [[nodiscard]] StopReport take_report() { return std::move(report_); }

 private:
  /// Attempts at one server run one at a time. After the deadline, the remaining ones count as
  /// failed.
  struct Server {
    std::deque<std::pair<StopTarget, std::string>> left{};
    bool is_served = false;
  };

  void take(names::ServiceAnswer answer);
  void add(const StopTarget& target, const names::NameEntry& entry, rt::ParallelJobs& jobs);
  void add(const StopTarget& target, const std::string& url, bool is_listed,
           rt::ParallelJobs& jobs);
  void serve(const std::string& authority);
  [[nodiscard]] Tried attempt(const std::string& url, StopScope scope);
  void tell(const std::string& hub);
  void note(std::string sentence);
  [[nodiscard]] rt::ParallelJobs& jobs_of(const std::string& service);

  rpc::Node& node_;
  const StopRoundConfig config_;
  const std::uint64_t id_;
  rt::PiMutex mutex_;  ///< Guards the members below.
  std::map<StopTarget, Tried> tried_{};
  std::set<std::pair<StopTarget, std::string>> begun_{};
  std::map<std::string, Server> servers_{};
  std::set<std::string> hubs_{};
  bool has_answer_ = false;
  StopReport report_{};
  /// Each service has its own threads, so that one service's devices do not delay another's.
  std::map<std::string, std::unique_ptr<rt::ParallelJobs>> jobs_{};
};

}  // namespace rtpm::gvd
