#pragma once

#include <sys/types.h>

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "outcome.hpp"

namespace rtpm::bench {

/// A server in a process of its own, as in real use. It is forked, so make it before this process
/// starts a thread. It ends with this object, or with this process however that ends.
/// Threads: one at a time.   Set-up only, but for pause() and resume().
class ServerProcess {
 public:
  /// The body of the new process: sets the server up and returns its address, or why it could not
  /// be set up. The server's threads serve until the process is ended.
  using SetUp = std::function<Outcome<std::string>()>;

  [[nodiscard]] static Outcome<ServerProcess> start(const SetUp& set_up);
  /// Like start(), but the new process runs another program, `command` with its path first. The
  /// program writes "+address" or "-reason" to its standard output, closes it, and serves until it
  /// is ended.
  [[nodiscard]] static Outcome<ServerProcess> start_program(std::vector<std::string> command);
  ServerProcess(ServerProcess&& other) noexcept;
  ServerProcess& operator=(ServerProcess&&) = delete;
  ~ServerProcess();

  /// The address that the set-up returned.
  [[nodiscard]] const std::string& address() const noexcept { return address_; }
  [[nodiscard]] pid_t id() const noexcept { return id_; }

  /// Takes the server off its CPU and brings it back. Two servers that spin on one CPU would starve
  /// each other; so the one that is not measured is stopped.   RT: two syscalls.
  void pause() const noexcept;
  void resume() const noexcept;

 private:
  ServerProcess(pid_t id, std::string address) : id_(id), address_(std::move(address)) {}
  /// Forks; the child runs `body`, which writes "+address" or "-reason" to the pipe, and ends when
  /// `body` returns.
  [[nodiscard]] static Outcome<ServerProcess> fork_with(
      const std::function<void(int ready_pipe)>& body);

  pid_t id_ = -1;
  std::string address_;
};

/// Servers that run as long as this object lives, and are stopped otherwise.
class Running {
 public:
  explicit Running(std::vector<const ServerProcess*> servers) : servers_(std::move(servers)) {
    for (const ServerProcess* server : servers_)
      server->resume();
  }
  Running(const Running&) = delete;
  Running& operator=(const Running&) = delete;
  ~Running() {
    for (const ServerProcess* server : servers_)
      server->pause();
  }

 private:
  std::vector<const ServerProcess*> servers_;
};

}  // namespace rtpm::bench
