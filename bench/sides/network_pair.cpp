#include "sides/network_pair.hpp"

#include <fcntl.h>
#include <sched.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <sstream>
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

/// The rule for one direction. It drops on input: the kernel reports a drop on output to the
/// sender, which no network does.
std::string rules_of(Carrier carrier, std::string_view which_port, std::uint16_t port,
                     double percent) {
  std::ostringstream rules;
  rules << "table inet rtpm_bench { chain loss { type filter hook input priority 0; policy accept; "
        << (carrier == Carrier::kTcp ? "tcp " : "udp ") << which_port << " " << port
        << " numgen random mod 1000 < " << std::lround(percent * 10) << " counter drop; }; }";
  return rules.str();
}

}  // namespace

NetworkPair::NetworkPair(NetworkPair&& other) noexcept
    : namespaces_(std::exchange(other.namespaces_, {-1, -1})) {}

NetworkPair& NetworkPair::operator=(NetworkPair&& other) noexcept {
  std::swap(namespaces_, other.namespaces_);
  return *this;
}

NetworkPair::~NetworkPair() {
  for (const int descriptor : namespaces_) {
    if (descriptor >= 0) close(descriptor);
  }
}

expected<NetworkPair, std::string> NetworkPair::create() {
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
    return unexpected{std::string("a network namespace can't be made (") + std::strerror(error) +
                      "), which takes the right CAP_SYS_ADMIN; run it as root"};
  }
  if (!is_home) return unexpected{std::string("the way back from a new network namespace failed")};
  // The descriptor names the other host to the program: `ip` is a child of this process.
  const std::string client = "/proc/" + std::to_string(getpid()) + "/fd/" +
                             std::to_string(pair.namespaces_[index_of(Host::kClient)]);
  expected<std::string, std::string> done;
  for (const auto& [host, command] :
       {std::pair{Host::kServer, "link add rtpm type veth peer name rtpm netns " + client},
        {Host::kServer, "address add " + std::string(kServerAddress) + "/30 dev rtpm"},
        {Host::kClient, "address add " + std::string(kClientAddress) + "/30 dev rtpm"},
        {Host::kServer, "link set rtpm up"},
        {Host::kClient, "link set rtpm up"}}) {
    if (done) done = pair.run(host, "ip " + command);
  }
  if (!done) return unexpected{done.error()};
  return pair;
}

expected<void, std::string> NetworkPair::enter(Host host) const {
  if (setns(namespaces_[index_of(host)], CLONE_NEWNET) == 0) return {};
  return unexpected{std::string("a network namespace can't be entered: ") + std::strerror(errno)};
}

expected<std::string, std::string> NetworkPair::run(Host host, const std::string& command) const {
  const int home = open_own_namespace();
  if (auto entered = enter(host); !entered) return unexpected{entered.error()};
  auto [output, exit_code] = run_program(command);
  const bool is_home = home >= 0 && setns(home, CLONE_NEWNET) == 0;
  close(home);
  if (!is_home) return unexpected{std::string("the way back from a network namespace failed")};
  if (exit_code == 0) return output;
  const bool is_ip = command.starts_with("ip ");
  if (exit_code == kNoSuchProgram) {
    return unexpected{std::string("the program '") + (is_ip ? "ip" : "nft") +
                      "' is missing; install Debian's package " +
                      (is_ip ? "iproute2" : "nftables")};
  }
  // Keeps the first line: a reason is one sentence.
  const std::string reason = output.substr(0, output.find('\n'));
  return unexpected{command + " failed: " +
                    (reason.empty() ? "it takes the rights CAP_NET_ADMIN and CAP_SYS_ADMIN; run "
                                      "it as root"
                                    : reason)};
}

expected<void, std::string> NetworkPair::drop(Carrier carrier, std::uint16_t port,
                                              double percent) const {
  for (const auto& [host, which_port] :
       {std::pair{Host::kServer, "dport"}, {Host::kClient, "sport"}}) {
    const auto done = run(host, "nft '" + rules_of(carrier, which_port, port, percent) + "'");
    if (!done) return unexpected{done.error()};
  }
  return {};
}

expected<std::uint64_t, std::string> NetworkPair::dropped_count() const {
  std::uint64_t count = 0;
  for (const Host host : {Host::kServer, Host::kClient}) {
    const auto listing = run(host, "nft list table inet rtpm_bench");
    if (!listing) return unexpected{listing.error()};
    constexpr std::string_view kBefore = "counter packets ";
    const std::size_t at = listing->find(kBefore);
    if (at == std::string::npos) return unexpected{std::string("'nft list' shows no counter")};
    count += std::strtoull(listing->c_str() + at + kBefore.size(), nullptr, 10);
  }
  return count;
}

std::uint64_t network_counter(std::string_view protocol, std::string_view name) {
  // Each protocol has a line of names, and below it a line of values.
  std::ifstream file("/proc/thread-self/net/snmp");
  const std::string begin = std::string(protocol) + ":";
  std::string names;
  std::string values;
  while (std::getline(file, names) && std::getline(file, values)) {
    if (!names.starts_with(begin)) continue;
    std::istringstream name_words(names);
    std::istringstream value_words(values);
    std::string name_word;
    std::string value_word;
    while (name_words >> name_word && value_words >> value_word) {
      if (name_word == name) return std::strtoull(value_word.c_str(), nullptr, 10);
    }
  }
  return 0;
}

}  // namespace rtpm::bench
