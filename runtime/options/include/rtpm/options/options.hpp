#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/priority.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/rt/thread.hpp"
#include "rtpm/rt/wait.hpp"

namespace rtpm::options {

/// The permitted values of a number or a time, both ends included.
template <class T>
struct Range {
  T low;
  T high;
};

/// Whether a positional argument may be omitted.
enum class Presence : std::uint8_t { kOptional, kRequired };

/// The options of one program, in one table: each has a key, and with it a flag `--key`, an
/// environment variable and a line `key = value` in the file that `--config FILE` or RTPM_CONFIG
/// names. A flag overrides the environment, the environment overrides the file, and the file
/// overrides the default, the variable's value when it was added. The format of the file:
/// runtime/options/README.md.
///
/// Programs share one environment, so a variable has one meaning: `--some-key` of `rtpm-servo` is
/// RTPM_SERVO_SOME_KEY. Options that this library adds to several programs are the same in all,
/// RTPM_SOME_KEY.
///
/// Every program also has --help, --version, --config and --dump-config, which prints the
/// configuration in force in the format of --config.
///
/// A variable RTPM_… that matches no key of this program may belong to another: it is no error, and
/// --dump-config lists it in a comment.
///
/// @ownership refers to the added variables until parse() returns
/// @threads  one
/// @realtime set-up only
class Options {
 public:
  /// @param name  the program's, as users type it
  /// @param description  one clause for --help
  Options(std::string name, std::string description);
  Options(const Options&) = delete;
  Options& operator=(const Options&) = delete;
  ~Options();

  /// Adds an option. A bool's flag may omit its value: `--verbose`, or `--verbose=false`.
  /// @param key   lower-case letters, digits and `-`; not yet in use
  /// @param help  what the option does, with its unit if its name has none
  void add(std::string key, std::string& value, std::string help);
  void add(std::string key, bool& value, std::string help);
  void add(std::string key, int& value, std::string help,
           Range<int> range = {INT32_MIN, INT32_MAX});
  void add(std::string key, std::uint16_t& value, std::string help,
           Range<std::uint16_t> range = {0, UINT16_MAX});
  void add(std::string key, std::uint32_t& value, std::string help,
           Range<std::uint32_t> range = {0, UINT32_MAX});
  void add(std::string key, std::uint64_t& value, std::string help,
           Range<std::uint64_t> range = {0, UINT64_MAX});
  void add(std::string key, double& value, std::string help, Range<double> range = {-1e308, 1e308});
  void add(std::string key, Duration& value, std::string help,
           Range<Duration> range = {Duration{0}, Duration::max()});
  void add(std::string key, Priority& value, std::string help);
  void add(std::string key, std::vector<std::string>& value, std::string help);
  /// A list of CPU numbers, 0 to 1023.
  void add(std::string key, std::vector<int>& value, std::string help);
  /// Adds an option that is a time, or "off" for none.
  void add_off_or_time(std::string key, std::optional<Duration>& value, std::string help,
                       Range<Duration> range = {Duration{0}, Duration::max()});
  /// Adds a secret, such as a password. It comes from the environment or the file, is refused on
  /// the command line, which all users of the host can read, and is never printed.
  /// @param file  the other place where it may be: "the file of --config"
  void add_secret(std::string key, std::string& value, std::string help,
                  const std::string& file = "the file of --config");
  /// Adds a list of names, each with options of its own. parse() calls `add_members` once with
  /// those configured, or else in `names`, and it adds their options. A name has letters, digits,
  /// '.', '_' and '-', at most `size_max` bytes. They differ in more than case and punctuation.
  void add_group(std::string key, std::vector<std::string>& names, std::string help,
                 std::size_t size_max,
                 std::function<void(const std::vector<std::string>& names)> add_members);
  /// Adds an option that is one of `choices`.
  void add_choice(std::string key, std::string& value, const std::vector<std::string>& choices,
                  std::string help);

  /// Adds a positional argument, in the order of the calls. It has neither an environment variable
  /// nor a line in the file. A list takes all remaining arguments, so add it last.
  void add_positional(std::string name, std::string& value, std::string help,
                      Presence presence = Presence::kOptional);
  void add_positional(std::string name, std::vector<std::string>& value, std::string help,
                      Presence presence = Presence::kOptional);

  /// Adds a verb, a permitted first argument; parse() then refuses any other word there.
  /// @param arguments  the form of what follows it: "TARGET [JSON]"
  /// @param help       one line for --help
  /// @param details    further lines for `PROGRAM VERB --help`, each ending with '\n'
  void add_verb(std::string name, std::string arguments, std::string help,
                std::string details = {});

  /// While it lives, the options that are added mean the same in every program that defines them.
  class Shared {
   public:
    explicit Shared(Options& options) noexcept;
    Shared(const Shared&) = delete;
    Shared& operator=(const Shared&) = delete;
    ~Shared();

   private:
    Options& options_;
    bool was_shared_;
  };

  /// Adds --realtime prefer|require|off.
  void add_realtime(rt::RealtimeMode& mode);
  /// Adds --wait adaptive|periodic|block|spin and --spin DURATION, their keys after `prefix`.
  void add_wait(rt::WaitConfig& wait, const std::string& prefix = {});
  /// Adds an option that is fifo or time-shared.
  void add_schedule(std::string key, rt::Schedule& schedule, std::string help);
  /// Adds --registry URL and --discover HOW, which is for programs without --registry; `where` gets
  /// the one that counts. Once.
  void add_registry(std::string& where);

  /// Reads file, environment and command line into the variables.
  /// @return nothing to continue, else the exit code: 0 after --help, --version or --dump-config
  /// @errors exit code 2, after one sentence on standard error; some variables may have changed
  [[nodiscard]] std::optional<int> parse(int argc, const char* const* argv);

  /// Prints "<program>: <what>; run '<program> --help' …" on standard error, for a program's own
  /// checks of its options. `what` is a clause without a full stop.
  /// @return 2, the exit code
  [[nodiscard]] int usage_error(std::string_view what) const;
  /// Reports wrong arguments of a verb: "<program>: usage: <program> <verb> …; run …".
  [[nodiscard]] int usage_error_of_verb(std::string_view verb) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtpm::options
