#include "sides/network_pair.hpp"

#include <fcntl.h>
#include <sched.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <utility>

namespace rtpm::bench {
namespace {

constexpr int kNoSuchProgram = 127;

int open_own_namespace() {
  return open("/proc/thread-self/ns/net", O_RDONLY | O_CLOEXEC);
}

/// A program's output and its exit status.
std::pair<std::string, int> run_program(const std::string& command) {
  std::string output;
  FILE* const pipe = popen((command + " 2>&1").c_str(), "r");
  if (pipe == nullptr) return {"no pipe for a program", -1};
  std::array<char, 4096> part{};
  while (const std::size_t size = fread(part.data(), 1, part.size(), pipe))
    output.append(part.data(), size);
  const int status = pclose(pipe);
  return {output, WIFEXITED(status) ? WEXITSTATUS(status) : -1};
}

}  // namespace

NetworkPair::NetworkPair(NetworkPair&& other) noexcept
    : namespaces_(std::exchange(other.namespaces_, {-1, -1})) {}

NetworkPair::~NetworkPair() {
  for (const int descriptor : namespaces_) {
    if (descriptor >= 0) close(descriptor);
  }
}

Outcome<NetworkPair> NetworkPair::create() {
  NetworkPair pair;
  const int home = open_own_namespace();
  int error = 0;
  for (int& descriptor : pair.namespaces_) {
    descriptor = unshare(CLONE_NEWNET) == 0 ? open_own_namespace() : -1;
    if (descriptor < 0) error = errno;
  }
  const bool is_home = home >= 0 && setns(home, CLONE_NEWNET) == 0;
  if (home >= 0) close(home);
  if (error != 0) {
    return failure(std::string("a network namespace can't be made (") + std::strerror(error) +
                   "), which takes the right CAP_SYS_ADMIN; run it as root");
  }
  if (!is_home) return failure("the way back from a new network namespace failed");
  // The descriptor names the other host to the program: `ip` is a child of this process.
  const std::string client = "/proc/" + std::to_string(getpid()) + "/fd/" +
                             std::to_string(pair.namespaces_[index_of(Host::kClient)]);
  Outcome<> done;
  for (const auto& [host, command] :
       {std::pair{Host::kServer, "link add rtpm type veth peer name rtpm netns " + client},
        {Host::kServer, "address add " + std::string(kServerAddress) + "/30 dev rtpm"},
        {Host::kClient, "address add " + std::string(kClientAddress) + "/30 dev rtpm"},
        {Host::kServer, "link set rtpm up"},
        {Host::kClient, "link set rtpm up"}}) {
    if (done) done = pair.run(host, command);
  }
  if (!done) return failure(done.error());
  return pair;
}

Outcome<> NetworkPair::enter(Host host) const {
  if (setns(namespaces_[index_of(host)], CLONE_NEWNET) == 0) return {};
  return failure(std::string("a network namespace can't be entered: ") + std::strerror(errno));
}

Outcome<> NetworkPair::run(Host host, const std::string& arguments) const {
  const int home = open_own_namespace();
  if (auto entered = enter(host); !entered) return entered;
  const auto [output, exit_code] = run_program("ip " + arguments);
  const bool is_home = home >= 0 && setns(home, CLONE_NEWNET) == 0;
  close(home);
  if (!is_home) return failure("the way back from a network namespace failed");
  if (exit_code == 0) return {};
  if (exit_code == kNoSuchProgram) {
    return failure("the program 'ip' is missing; install Debian's package iproute2");
  }
  // Keeps the first line: a reason is one sentence.
  return failure("ip " + arguments + " failed: " + output.substr(0, output.find('\n')));
}

}  // namespace rtpm::bench
