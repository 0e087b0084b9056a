#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "peer.hpp"

namespace rtpm::bench {
namespace {

sockaddr_in local_address(std::uint16_t port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  return address;
}

bool can_connect(int family, const void* address, socklen_t size) {
  const int handle = socket(family, SOCK_STREAM, 0);
  const bool is_there = connect(handle, static_cast<const sockaddr*>(address), size) == 0;
  close(handle);
  return is_there;
}

bool is_serving(const BrokerProgram& broker) {
  const sockaddr_in port = local_address(broker.port);
  if (broker.path.empty()) return can_connect(AF_INET, &port, sizeof port);
  sockaddr_un path{};
  path.sun_family = AF_UNIX;
  broker.path.copy(path.sun_path, sizeof path.sun_path - 1);
  return can_connect(AF_UNIX, &path, sizeof path);
}

Outcome wait_until_serving(const BrokerProgram& broker) {
  const MonotonicTime give_up = rt::now() + std::chrono::seconds{10};
  while (!is_serving(broker)) {
    if (rt::now() > give_up) return unexpected{std::string("the broker does not serve after 10 s")};
    rt::sleep_until(rt::now() + std::chrono::milliseconds{10});
  }
  return {};
}

}  // namespace

std::uint16_t free_port() {
  const int handle = socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address = local_address(0);
  socklen_t size = sizeof address;
  auto* const generic = reinterpret_cast<sockaddr*>(&address);
  const bool is_bound =
      bind(handle, generic, size) == 0 && getsockname(handle, generic, &size) == 0;
  close(handle);
  return is_bound ? ntohs(address.sin_port) : std::uint16_t{0};
}

Outcome become_broker(BrokerProgram broker, const rt::ThreadConfig& config,
                      void (*report)(const Outcome&)) {
  const pid_t child = fork();
  if (child < 0) return unexpected{std::string("no process for a broker")};
  if (child == 0) {
    report(wait_until_serving(broker));
    _exit(0);
  }
  if (auto set = rt::configure_this_thread(config); !set) return unexpected{set.error().text()};
  const int nowhere = open("/dev/null", O_WRONLY);
  dup2(nowhere, STDOUT_FILENO);
  dup2(nowhere, STDERR_FILENO);
  std::vector<char*> arguments;
  for (std::string& argument : broker.command)
    arguments.push_back(argument.data());
  arguments.push_back(nullptr);
  execv(arguments[0], arguments.data());
  _exit(1);
}

}  // namespace rtpm::bench
