#pragma once

namespace rtpm::rpc {

/// The right to use what belongs to a lane's leader: its sources, sessions, open calls and report.
/// The only thread of a lane has it permanently; a thread of a pool has it while it holds the lock.
class Lead {
 public:
  Lead(const Lead&) = delete;
  Lead& operator=(const Lead&) = delete;

 private:
  friend class Lane;  // While none of its threads runs.
  friend class SoloExecution;
  friend class ThreadPool;
  Lead() noexcept = default;
};

}  // namespace rtpm::rpc
