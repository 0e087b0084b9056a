#pragma once

#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <map>
#include <string>
#include <thread>

// The kernel itself counts system calls: a seccomp filter reports each one of a thread before it
// runs.   Source: seccomp_unotify(2).
namespace rtpm::test {

/// Lets the kernel report the calling thread's system calls to a descriptor; -1 if it may not.
inline int report_this_thread() {
  if (prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0) return -1;
  std::array<sock_filter, 1> all{sock_filter{BPF_RET | BPF_K, 0, 0, SECCOMP_RET_USER_NOTIF}};
  const sock_fprog program{static_cast<unsigned short>(all.size()), all.data()};
  return static_cast<int>(
      syscall(SYS_seccomp, SECCOMP_SET_MODE_FILTER, SECCOMP_FILTER_FLAG_NEW_LISTENER, &program));
}

/// Counts the reported calls, on a thread of its own that is not reported itself: without it no
/// system call of a watched thread completes.
class SyscallCounter {
 public:
  SyscallCounter() : thread_([this] { run(); }) {}
  SyscallCounter(const SyscallCounter&) = delete;
  SyscallCounter& operator=(const SyscallCounter&) = delete;
  /// Requires that the watched thread has ended.
  ~SyscallCounter() {
    thread_.join();
    close(descriptor_);
  }

  /// Watches the calling thread, for good.
  void watch_this_thread() { descriptor_ = report_this_thread(); }
  [[nodiscard]] bool may_watch() const { return descriptor_ != -1; }
  /// Starts or stops the counting.
  void count(bool is_on) { is_counting_ = is_on; }
  [[nodiscard]] int total() const { return total_; }
  [[nodiscard]] std::string text(const std::string& name) const {
    std::string text;
    for (const auto& [number, count] : counts_)
      text += name + " " + std::to_string(number) + " " + std::to_string(count) + "\n";
    return text;
  }

 private:
  void run() {
    while (descriptor_ == 0)
      std::this_thread::yield();
    while (descriptor_ > 0) {
      pollfd entry{descriptor_, POLLIN, 0};
      if (poll(&entry, 1, -1) <= 0) continue;
      if ((entry.revents & POLLHUP) != 0) return;
      seccomp_notif call{};
      if (ioctl(descriptor_, SECCOMP_IOCTL_NOTIF_RECV, &call) != 0) continue;
      if (is_counting_) {
        ++counts_[call.data.nr];
        ++total_;
      }
      seccomp_notif_resp answer{};
      answer.id = call.id;
      answer.flags = SECCOMP_USER_NOTIF_FLAG_CONTINUE;
      ioctl(descriptor_, SECCOMP_IOCTL_NOTIF_SEND, &answer);
    }
  }

  std::atomic<int> descriptor_{0};
  std::atomic<bool> is_counting_{false};
  std::atomic<int> total_{0};
  std::map<int, int> counts_;
  std::thread thread_;
};

}  // namespace rtpm::test
