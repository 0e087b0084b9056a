#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <utility>

#include "cli/command.hpp"
#include "cli/output.hpp"
#include "cli/progress.hpp"
#include "laboratory/commands.hpp"
#include "laboratory/process.hpp"
#include "rtpm/program/text.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/log.hpp"
#include "rtpm/wire/url.hpp"

// A running laboratory locks its pid file, so that its name is unique and `rtpm down` finds it.
namespace rtpm::tool {
namespace {

using transport::Descriptor;

constexpr const char* kPidFile = ".pid";
constexpr Duration kTurn = std::chrono::milliseconds{20};
constexpr Duration kDownPatience = std::chrono::minutes{1};

/// A laboratory running on this host.
struct Running {
  std::string name{};
  pid_t process = 0;
  std::string file{};
};

/// The folder of this user's pid files and logs.
expected<std::string, SetupError> state_folder() {
  const char* const runtime = std::getenv("XDG_RUNTIME_DIR");
  const std::string path = runtime != nullptr && *runtime == '/'
                               ? std::string(runtime) + "/rtpm"
                               : "/tmp/rtpm-" + std::to_string(::geteuid());
  struct stat found {};
  if ((::mkdir(path.c_str(), 0700) != 0 && errno != EEXIST) || ::lstat(path.c_str(), &found) != 0)
    return setup_error("the folder " + path + " can't be made", system_error(errno));
  if (S_ISDIR(found.st_mode) && found.st_uid == ::geteuid() && (found.st_mode & 077) == 0)
    return path;
  return setup_error("the folder " + path + " is not safe", "others may enter it",
                     "chmod 700 " + path + ", or set XDG_RUNTIME_DIR to a folder of your own");
}

/// A lock on the open file, which forked processes share.
struct flock whole_file() {
  struct flock lock {};
  lock.l_type = F_WRLCK;
  lock.l_whence = SEEK_SET;
  return lock;
}

/// Locks the pid file. A pid file that is not locked is stale.
expected<Descriptor, SetupError> lock_pid_file(const std::string& folder, const std::string& name) {
  const std::string path = folder + "/" + name + kPidFile;
  Descriptor file(::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600));
  if (!file.is_open()) return setup_error(path + " can't be made", system_error(errno));
  struct flock lock = whole_file();
  if (::fcntl(file.number(), F_OFD_SETLK, &lock) == 0) {
    static_cast<void>(!::ftruncate(file.number(), 0));  // Removes the outdated pid.
    return file;
  }
  return setup_error("the laboratory '" + name + "' is already up", "",
                     "`rtpm down " + name + "` ends it");
}

/// The laboratories whose pid files are locked, by name.
std::vector<Running> all_running(const std::string& folder) {
  std::vector<Running> all;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(folder, error)) {
    if (entry.path().extension() != kPidFile) continue;
    const Descriptor file(::open(entry.path().c_str(), O_RDWR | O_CLOEXEC | O_NOFOLLOW));
    struct flock lock = whole_file();
    if (::fcntl(file.number(), F_OFD_GETLK, &lock) != 0 || lock.l_type == F_UNLCK) continue;
    Running laboratory{.name = entry.path().stem()};
    std::ifstream text(entry.path());
    text >> laboratory.process >> std::ws;
    std::getline(text, laboratory.file);
    if (laboratory.process > 0)
      all.push_back(std::move(laboratory));  // Other values would mean process groups to kill().
  }
  std::ranges::sort(all, {}, &Running::name);
  return all;
}

/// Continues in a new session, with output to a log.
void leave_terminal(const std::string& log) {
  ::setsid();
  // Programs may print lines that only their user may read, such as a console's URL.
  ::unlink(log.c_str());
  const Descriptor file(::open(log.c_str(), O_RDWR | O_CREAT | O_APPEND | O_CLOEXEC, 0600));
  for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO})
    ::dup2(file.number(), stream);
}

/// Waits until the background process reports that everything serves, or ends with an error.
int await_background(Context& context, pid_t background, int report, const std::string& name,
                     const std::string& log) {
  bool has_passed_stop = false;
  pollfd waited{report, POLLIN, 0};
  while (::poll(&waited, 1, 100) <= 0) {
    if (context.stop().is_requested() && !std::exchange(has_passed_stop, true))
      ::kill(background, SIGTERM);
  }
  int status = 0;
  if (::read(report, &status, 1) == 1) {
    if (context.json) return kDone;
    print_line(name + " serves in the background; `rtpm down " + name + "` ends it, its log is " +
               log);
    return kDone;
  }
  ::waitpid(background, &status, 0);
  std::string error;
  std::ifstream lines(log);
  for (std::string line; std::getline(lines, line);)
    error = line + "\n";
  static_cast<void>(!::write(STDERR_FILENO, error.data(), error.size()));
  return WIFEXITED(status) ? WEXITSTATUS(status) : kFailed;
}

/// Ends a laboratory, and waits until all of its processes have ended.
int end_laboratory(Context& context, const std::string& folder, const Running& laboratory) {
  ::kill(laboratory.process, SIGTERM);
  const MonotonicTime end = rt::now() + kDownPatience;
  StatusLine progress(context);
  const auto is_it = [&](const Running& other) { return other.process == laboratory.process; };
  while (std::ranges::any_of(all_running(folder), is_it)) {
    progress.show(laboratory.name + " is stopping");
    if (context.stop().wait_for(kTurn) || rt::now() >= end) {
      return context.fail({"the laboratory '" + laboratory.name + "' is still stopping", "",
                           "kill " + std::to_string(laboratory.process) + " ends it at once"});
    }
  }
  if (context.json) print_json({{"name", laboratory.name}, {"ended", true}});
  if (!context.json) print_line(laboratory.name + " has ended");
  return kDone;
}

int down(Context& context, const std::string& name) {
  const auto folder = state_folder();
  if (!folder) return context.fail(folder.error());
  const std::vector<Running> all = all_running(*folder);
  std::vector<std::string> names;
  std::string list;
  for (const Running& laboratory : all) {
    if (laboratory.name == name || (name.empty() && all.size() == 1))
      return end_laboratory(context, *folder, laboratory);
    names.push_back(laboratory.name);
    list += (list.empty() ? "" : ", ") + laboratory.name + " (" + laboratory.file + ")";
  }
  if (all.empty())
    return context.fail("no laboratory " + (name.empty() ? "" : "'" + name + "' ") +
                        "of this user is up on this host");
  if (!name.empty())
    return context.fail("no laboratory '" + name + "' is up" + program::suggestion(name, names) +
                        "; there are: " + list);
  return context.fail(
      {"several laboratories are up: " + list, "", "name one: rtpm down " + names.front()},
      kMisused);
}

}  // namespace

int bring_up(Context& context, const expected<laboratory::Plan, std::vector<SetupError>>& read,
             bool is_detached) {
  for (const SetupError& error : read ? std::vector<SetupError>() : read.error())
    context.fail(error, kMisused);
  if (!read) return kMisused;
  const laboratory::Plan& plan = *read;
  const auto folder = state_folder();
  if (!folder) return context.fail(folder.error());
  const auto pid_file = lock_pid_file(*folder, plan.name);
  if (!pid_file) return context.fail(pid_file.error());
  for (const std::string& name : plan.left_out)
    rt::print_error("rtpm", "the program '" + name + "' is left out: it is not installed");
  std::array<int, 2> report{-1, -1};
  if (is_detached) {
    const std::string log = *folder + "/" + plan.name + ".log";
    std::fflush(nullptr);
    const pid_t background = ::pipe2(report.data(), O_CLOEXEC) == 0 ? ::fork() : -1;
    if (background < 0)
      return context.fail(
          SetupError{"the laboratory does not start", system_error(errno).message()});
    ::close(report[background > 0 ? 1 : 0]);
    if (background > 0) return await_background(context, background, report[0], plan.name, log);
    leave_terminal(log);
  }
  ::dprintf(pid_file->number(), "%d\n%s\n", ::getpid(), plan.file.c_str());
  // For programs whose environment in the file sets no registry.
  ::setenv(wire::is_url(context.registry) ? "RTPM_REGISTRY" : "RTPM_DISCOVER",
           context.registry.c_str(), 1);
  Duration patience{};
  for (const laboratory::ProgramPlan& program : plan.programs)
    patience = std::max(patience, program.stop_patience);
  const auto exit_code = laboratory::run_guarded(
      [&] { return supervise(context, plan, !is_detached && !context.json, report[1]); }, patience);
  if (!exit_code) return context.fail(exit_code.error());
  if (*exit_code) return **exit_code;
  return context.fail(SetupError{"the laboratory '" + plan.name + "' has ended",
                                 "its supervisor was killed", "see the system's log (dmesg)"});
}

void add_down(CLI::App& program, Context& context) {
  const auto name = std::make_shared<std::string>();
  CLI::App& command = add_command(
      program, context, "down", "End a laboratory that `rtpm up` has brought up on this host",
      "  rtpm down cell\n"
      "Ends all its programs in reverse order, and returns when no process is left. Without a "
      "name\nit ends the only one.\n",
      [name](Context& c) { return down(c, *name); });
  command.add_option("NAME", *name, "The laboratory")->type_name("");
}

}  // namespace rtpm::tool
