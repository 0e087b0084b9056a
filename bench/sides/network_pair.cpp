#include "sides/network_pair.hpp"

#include <fcntl.h>
#include <sched.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>
#include <sstream>
#include <utility>

namespace rtpm::bench {
namespace {

constexpr int kNoSuchProgram = 127;
constexpr const char* kOwnNamespace = "/proc/thread-self/ns/net";

std::size_t index_of(NetworkPair::Host host) {
  return static_cast<std::size_t>(host);
}

int open_own_namespace() {
  return open(kOwnNamespace, O_RDONLY | O_CLOEXEC);
}

/// Puts the calling thread in a new network namespace and gives a descriptor of it, or -1.
int open_new_namespace() {
  return unshare(CLONE_NEWNET) == 0 ? open_own_namespace() : -1;
}

/// In the child: becomes the program in the namespace. Everything there is open to it.
[[noreturn]] void become(int network, const std::vector<std::string>& command, int input,
                         int output) {
  std::vector<char*> arguments;
  arguments.reserve(command.size() + 1);
  for (const std::string& word : command)
    arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  if (setns(network, CLONE_NEWNET) != 0 || dup2(input, STDIN_FILENO) < 0 ||
      dup2(output, STDOUT_FILENO) < 0 || dup2(output, STDERR_FILENO) < 0) {
    _exit(1);
  }
  execvp(arguments.front(), arguments.data());
  _exit(errno == ENOENT ? kNoSuchProgram : 1);
}

std::string read_all(int pipe) {
  std::string text;
  std::array<char, 4096> part{};
  ssize_t size = 0;
  while ((size = read(pipe, part.data(), part.size())) > 0)
    text.append(part.data(), static_cast<std::size_t>(size));
  return text;
}

std::string package_of(const std::string& program) {
  return program == "ip" ? "iproute2" : "nftables";
}

/// The rule for one direction. What comes in is dropped, because a sender is told of what a rule
/// drops on its way out, and no network tells.
std::string rules_of(Carrier carrier, std::string_view which_port, std::uint16_t port,
                     double percent) {
  std::ostringstream rules;
  rules << "table inet rtpm_bench {\n  chain loss {\n"
        << "    type filter hook input priority 0; policy accept;\n    "
        << (carrier == Carrier::kTcp ? "tcp " : "udp ") << which_port << " " << port
        << " numgen random mod 1000 < " << std::lround(percent * 10) << " counter drop\n  }\n}\n";
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
    descriptor = open_new_namespace();
    if (descriptor < 0) error = errno;
  }
  const bool is_home = home >= 0 && setns(home, CLONE_NEWNET) == 0;
  if (home >= 0) close(home);
  if (error != 0) {
    return unexpected{std::string("a network namespace can't be made (") + std::strerror(error) +
                      "), which takes the right CAP_SYS_ADMIN; run it as root"};
  }
  if (!is_home) return unexpected{std::string("the way back from a new network namespace failed")};
  // The descriptor is the child's, too, and so names the other host to the program.
  const std::string client =
      "/proc/self/fd/" +
      std::to_string(fcntl(pair.namespaces_[index_of(Host::kClient)], F_DUPFD, 3));
  const std::string server_address = std::string(kServerAddress) + "/30";
  const std::string client_address = std::string(kClientAddress) + "/30";
  const std::pair<Host, std::vector<std::string>> commands[] = {
      {Host::kServer,
       {"ip", "link", "add", "rtpm", "type", "veth", "peer", "name", "rtpm", "netns", client}},
      {Host::kServer, {"ip", "address", "add", server_address, "dev", "rtpm"}},
      {Host::kClient, {"ip", "address", "add", client_address, "dev", "rtpm"}},
      {Host::kServer, {"ip", "link", "set", "rtpm", "up"}},
      {Host::kClient, {"ip", "link", "set", "rtpm", "up"}},
  };
  expected<std::string, std::string> done;
  for (const auto& [host, command] : commands) {
    if (done) done = pair.run(host, command);
  }
  close(std::stoi(client.substr(client.rfind('/') + 1)));
  if (!done) return unexpected{done.error()};
  return pair;
}

expected<void, std::string> NetworkPair::enter(Host host) const {
  if (setns(namespaces_[index_of(host)], CLONE_NEWNET) == 0) return {};
  return unexpected{std::string("a network namespace can't be entered: ") + std::strerror(errno)};
}

expected<std::string, std::string> NetworkPair::run(Host host,
                                                    const std::vector<std::string>& command,
                                                    const std::string& input) const {
  std::array<int, 2> to{};
  std::array<int, 2> from{};
  if (pipe2(to.data(), O_CLOEXEC) != 0) return unexpected{std::string("no pipe for a program")};
  if (pipe2(from.data(), O_CLOEXEC) != 0) {
    close(to[0]);
    close(to[1]);
    return unexpected{std::string("no pipe for a program")};
  }
  const pid_t child = fork();
  if (child == 0) become(namespaces_[index_of(host)], command, to[0], from[1]);
  close(to[0]);
  close(from[1]);
  // Rules are far smaller than a pipe, so that this never waits.
  const bool is_fed =
      write(to[1], input.data(), input.size()) == static_cast<ssize_t>(input.size());
  close(to[1]);
  std::string output = read_all(from[0]);
  close(from[0]);
  int status = -1;
  if (child > 0) waitpid(child, &status, 0);
  const std::string& program = command.front();
  if (WIFEXITED(status) && WEXITSTATUS(status) == kNoSuchProgram) {
    return unexpected{"the program '" + program + "' is missing; install Debian's package " +
                      package_of(program)};
  }
  if (child > 0 && is_fed && WIFEXITED(status) && WEXITSTATUS(status) == 0) return output;
  std::string words;
  for (const std::string& word : command)
    words += (words.empty() ? "" : " ") + word;
  // One sentence, so one line.
  const std::string reason = output.substr(0, output.find('\n'));
  return unexpected{"'" + words + "' failed: " +
                    (reason.empty() ? "it takes the rights CAP_NET_ADMIN and CAP_SYS_ADMIN; run "
                                      "it as root"
                                    : reason)};
}

expected<void, std::string> NetworkPair::drop(Carrier carrier, std::uint16_t port,
                                              double percent) const {
  const std::pair<Host, std::string_view> directions[] = {{Host::kServer, "dport"},
                                                          {Host::kClient, "sport"}};
  for (const auto& [host, which_port] : directions) {
    const auto done = run(host, {"nft", "-f", "-"}, rules_of(carrier, which_port, port, percent));
    if (!done) return unexpected{done.error()};
  }
  return {};
}

expected<std::uint64_t, std::string> NetworkPair::dropped_count() const {
  std::uint64_t count = 0;
  for (const Host host : {Host::kServer, Host::kClient}) {
    const auto listing = run(host, {"nft", "list", "table", "inet", "rtpm_bench"});
    if (!listing) return unexpected{listing.error()};
    constexpr std::string_view kBefore = "counter packets ";
    const std::size_t at = listing->find(kBefore);
    if (at == std::string::npos) return unexpected{std::string("'nft list' shows no counter")};
    count += std::strtoull(listing->c_str() + at + kBefore.size(), nullptr, 10);
  }
  return count;
}

std::uint64_t network_counter(std::string_view protocol, std::string_view name) {
  // Per protocol a line of names and below it one of values.
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
