#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "rtpm/device_mpv/settings.hpp"

/// The transport to a real mpv: a stream socket and the mpv process at its other end.
namespace rtpm::device_mpv {
namespace {

using Opened = expected<std::unique_ptr<Transport>, SetupError>;

/// Owns a file descriptor.
class Handle {
 public:
  explicit Handle(int number) noexcept : number_(number) {}
  Handle(Handle&& other) noexcept : number_(std::exchange(other.number_, -1)) {}
  Handle& operator=(Handle&&) = delete;
  ~Handle() { reset(); }
  void reset() noexcept {
    if (number_ >= 0) ::close(std::exchange(number_, -1));
  }
  [[nodiscard]] int number() const noexcept { return number_; }

 private:
  int number_;
};

MonotonicTime clock_now() {
  const auto since = std::chrono::steady_clock::now().time_since_epoch();
  return MonotonicTime{std::chrono::duration_cast<Duration>(since)};
}

/// An mpv process started by this program; it ends when this object is destroyed.
class Child {
 public:
  explicit Child(pid_t id) noexcept : id_(id) {}
  Child(Child&& other) noexcept : id_(std::exchange(other.id_, -1)) {}
  Child& operator=(Child&&) = delete;
  /// mpv exits by itself when its connection closes; a hanging one is killed.
  ~Child() {
    if (id_ < 0) return;
    constexpr int kTurnMs = 10;
    for (int waited_ms = 0; waited_ms < 500; waited_ms += kTurnMs) {
      if (::waitpid(id_, nullptr, WNOHANG) != 0) return;
      static_cast<void>(::poll(nullptr, 0, kTurnMs));
    }
    ::kill(id_, SIGKILL);
    while (::waitpid(id_, nullptr, 0) < 0 && errno == EINTR) {
    }
  }

 private:
  pid_t id_;
};

class SocketTransport final : public Transport {
 public:
  SocketTransport(Handle socket, std::optional<Child> child) noexcept
      : child_(std::move(child)), socket_(std::move(socket)) {}

  bool send(std::string_view bytes) override {
    const ssize_t sent =
        ::send(socket_.number(), bytes.data(), bytes.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
    // A partial line would corrupt the next one, so the connection is closed.
    return sent == static_cast<ssize_t>(bytes.size());
  }
  Received receive(std::span<char> buffer, Duration patience) override {
    pollfd waited{socket_.number(), POLLIN, 0};
    const auto patience_ms = std::chrono::ceil<std::chrono::milliseconds>(patience).count();
    if (::poll(&waited, 1, static_cast<int>(patience_ms)) <= 0) return {};
    const ssize_t size = ::recv(socket_.number(), buffer.data(), buffer.size(), MSG_DONTWAIT);
    if (size > 0) return {static_cast<std::size_t>(size), false};
    const bool is_empty = size < 0 && (errno == EAGAIN || errno == EINTR);
    return {0, !is_empty};
  }
  [[nodiscard]] MonotonicTime now() const override { return clock_now(); }

 private:
  // Declared in this order: the connection closes first, so that the player exits.
  std::optional<Child> child_;
  Handle socket_;
};

Opened join(const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.size() >= sizeof address.sun_path) {
    return setup_error("the path of mpv's socket is too long", "", "choose one below 108 bytes");
  }
  path.copy(address.sun_path, path.size());
  Handle socket(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
  // NOLINTNEXTLINE(cppcoreguidelines-pro-type-reinterpret-cast): the system's interface
  const auto* const generic = reinterpret_cast<const sockaddr*>(&address);
  if (::connect(socket.number(), generic, sizeof address) != 0) {
    return setup_error("no mpv can be joined at " + path, system_error(errno),
                       "start mpv with --input-ipc-server=" + path);
  }
  return std::make_unique<SocketTransport>(std::move(socket), std::nullopt);
}

std::vector<std::string> command_of(const Settings& settings, int handle) {
  std::vector<std::string> words{"mpv",     "--no-config",     "--no-terminal", "--idle=yes",
                                 "--pause", "--keep-open=yes", "--hr-seek=yes"};
  words.push_back("--input-ipc-client=fd://" + std::to_string(handle));
  if (settings.is_headless) words.insert(words.end(), {"--vo=null", "--ao=null"});
  words.insert(words.end(), {"--", settings.file});
  return words;
}

/// Runs mpv with `theirs` as its connection.
expected<pid_t, int> spawn(const Settings& settings, int theirs) {
  constexpr int kHandle = 3;
  std::vector<std::string> words = command_of(settings, kHandle);
  std::vector<char*> arguments;
  for (std::string& word : words)
    arguments.push_back(word.data());
  arguments.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  ::posix_spawn_file_actions_init(&actions);
  ::posix_spawn_file_actions_adddup2(&actions, theirs, kHandle);
  posix_spawnattr_t attributes;
  ::posix_spawnattr_init(&attributes);
  sigset_t none;
  ::sigemptyset(&none);
  ::posix_spawnattr_setsigmask(&attributes, &none);
  // Puts mpv in a separate process group: Ctrl-C at the terminal reaches only this program, which
  // then ends the player.
  ::posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETPGROUP);
  pid_t id = -1;
  const int fault = ::posix_spawnp(&id, "mpv", &actions, &attributes, arguments.data(), environ);
  ::posix_spawnattr_destroy(&attributes);
  ::posix_spawn_file_actions_destroy(&actions);
  if (fault != 0) return unexpected{fault};
  return id;
}

Opened start(const Settings& settings) {
  if (::access(settings.file.c_str(), R_OK) != 0) {
    return setup_error("mpv can't play " + settings.file, system_error(errno),
                       "name a file that this program may read");
  }
  std::array<int, 2> pair{};
  if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, pair.data()) != 0) {
    return setup_error("there is no connection to mpv", system_error(errno));
  }
  Handle ours(pair[0]);
  const Handle theirs(pair[1]);
  const auto id = spawn(settings, theirs.number());
  if (!id) {
    return setup_error("mpv does not start", system_error(id.error()), "install the package mpv");
  }
  return std::make_unique<SocketTransport>(std::move(ours), std::optional<Child>(Child(*id)));
}

}  // namespace

OpenTransport open_mpv(Settings settings) {
  return [settings = std::move(settings)] {
    return settings.file.empty() ? join(settings.socket) : start(settings);
  };
}

}  // namespace rtpm::device_mpv
