#pragma once

#include <fcntl.h>
#include <sched.h>
#include <unistd.h>

#include <cstdlib>

namespace rtpm::test {

/// Gives the calling thread, and threads that it starts, a network namespace in which all addresses
/// of 10.77.0.0/16 are this host's. A call from one of them to another address comes, as far as a
/// server can tell, from another host.
/// @threads  made and destroyed by one
class OtherHosts {
 public:
  OtherHosts() : former_(open("/proc/thread-self/ns/net", O_RDONLY | O_CLOEXEC)) {
    if (former_ < 0 || unshare(CLONE_NEWNET) != 0) return;
    is_in_ = true;
    is_there_ = std::system("ip link set lo up && ip route add local 10.77.0.0/16 dev lo") == 0;
  }
  OtherHosts(const OtherHosts&) = delete;
  OtherHosts& operator=(const OtherHosts&) = delete;
  ~OtherHosts() {
    if (is_in_ && setns(former_, CLONE_NEWNET) != 0) std::abort();
    if (former_ >= 0) close(former_);
  }
  [[nodiscard]] bool is_there() const noexcept { return is_there_; }

  static constexpr const char* kMissing =
      "a network namespace takes the right CAP_SYS_ADMIN, and the program 'ip'";

 private:
  int former_;
  bool is_in_ = false;
  bool is_there_ = false;
};

}  // namespace rtpm::test
