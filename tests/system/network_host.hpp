#pragma once

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <unistd.h>

#include <cstdlib>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "programs.hpp"
#include "rtpm/test/process.hpp"

// Hosts, as network namespaces.
namespace rtpm::system_test {

/// Why network namespaces can't be created here; empty if they can.
[[nodiscard]] inline std::string missing_for_hosts() {
  if (geteuid() != 0) return "network namespaces take root";
  if (std::system("command -v ip >/dev/null") != 0) return "the program 'ip' is missing";
  const auto end = test::run({"/usr/bin/unshare", "--net", "true"}, kPatience);
  return end && end->exit_code == 0 ? "" : "network namespaces take the right CAP_SYS_ADMIN";
}

/// Runs a command of ip(8); the test fails if the command fails.
inline void ip(const std::string& command) {
  const int status = std::system(("ip " + command).c_str());
  EXPECT_EQ(status, 0) << "ip " << command;
}

/// A network namespace with a name of this process, which is removed with this object.
class Host {
 public:
  /// @param keys  the folder of its user's keys; if empty, the test's keys
  explicit Host(const std::string& name, std::string keys = {})
      : name_("rtpm" + std::to_string(getpid()) + name), keys_(std::move(keys)) {
    ip("netns add " + name_);
    run("link set lo up");
  }
  ~Host() { ip("netns delete " + name_); }
  Host(const Host&) = delete;
  Host& operator=(const Host&) = delete;

  [[nodiscard]] const std::string& name() const { return name_; }
  void run(const std::string& command) const { ip("-netns " + name_ + " " + command); }
  /// A cable to the other host; each end has the address, with the size of its network.
  void join(const std::string& interface, const std::string& address, const Host& other,
            const std::string& its_interface, const std::string& its_address) const {
    run("link add " + interface + " type veth peer name " + its_interface + " netns " +
        other.name());
    use(interface, address);
    other.use(its_interface, its_address);
  }
  void use(const std::string& interface, const std::string& address) const {
    // Does not wait for another host to have the same address.
    const bool is_ipv6 = address.find(':') != std::string::npos;
    if (!address.empty()) {
      run("address add " + address + " dev " + interface + (is_ipv6 ? " nodad" : ""));
    }
    run("link set " + interface + " up");
  }
  [[nodiscard]] std::vector<std::string> inside() const {
    std::vector<std::string> command{"/usr/bin/env"};
    if (!keys_.empty()) command.push_back("RTPM_KEYS=" + keys_);
    command.insert(command.end(), {"ip", "netns", "exec", name_});
    return command;
  }
  [[nodiscard]] std::optional<Daemon> start(std::string_view program,
                                            std::vector<std::string> arguments) const {
    arguments.insert(arguments.end(), {"--realtime", "off"});
    return start_daemon(program, std::move(arguments), inside());
  }
  [[nodiscard]] test::Process::End run_tool(std::vector<std::string> arguments) const {
    std::vector<std::string> command = inside();
    command.push_back(path_of("rtpm"));
    command.insert(command.end(), arguments.begin(), arguments.end());
    return test::run(command, kPatience).value_or(test::Process::End{});
  }
  /// Moves the calling thread, and threads that it starts, to this host.
  void enter() const {
    const int file = open(("/run/netns/" + name_).c_str(), O_RDONLY | O_CLOEXEC);
    ASSERT_EQ(setns(file, CLONE_NEWNET), 0);
    close(file);
  }

 private:
  std::string name_;
  std::string keys_;
};

}  // namespace rtpm::system_test
