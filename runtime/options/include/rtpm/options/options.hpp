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

/// The values that a number or a time may have, both ends included.
template <class T>
struct Range {
  T low;
  T high;
};

/// Whether a program can do without an argument.
enum class Presence : std::uint8_t { kOptional, kRequired };

/// The options of one program, in one table: each has a key, and with it a flag `--key`, an
/// environment variable `RTPM_KEY` (upper case, `-` as `_`) and a line `key = value` in the file
/// that `--config FILE` or RTPM_CONFIG names. A flag wins over the environment, the environment
/// over the file, the file over the default, which is what the variable held when it was added.
///
/// The file has one `key = value` a line; `#` begins a comment at the begin of a line or after a
/// blank; a value with blanks at its ends, `#`, `"` or `\` stands in double quotes, in which `\\`,
/// `\"` and `\xNN` mean one byte. Lists are written with commas everywhere; a list's flag may also
/// be repeated. A time has a unit: "800us", "1.5ms", "2s"; ns, us, ms, s, min and h are known.
///
/// Every program has, besides, --help, --version, --config and --dump-config, which prints the
/// configuration in force in the form that --config takes.
///
/// Programs share one environment, so a variable RTPM_… that is no key of this program is taken to
/// be another's: it is no error, and --dump-config names it in a comment.
///
/// Ownership: refers to the variables that were added, until parse() returns.
/// Threads: one.   Set-up only.
class Options {
 public:
  /// `name` is the program's, as people type it; `description` one sentence for --help.
  Options(std::string name, std::string description);
  Options(const Options&) = delete;
  Options& operator=(const Options&) = delete;
  ~Options();

  /// Adds an option. `key` is of lower-case letters, digits and `-`, and not yet in use; `help`
  /// says what the option does, with its unit if its name has none. A bool's flag takes no value
  /// (`--verbose`), but may (`--verbose=false`).
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
  /// The numbers are of CPUs: from 0 to 1023.
  void add(std::string key, std::vector<int>& value, std::string help);
  /// Adds an option that is a time, or "off" for none.
  void add_off_or_time(std::string key, std::optional<Duration>& value, std::string help,
                       Range<Duration> range = {Duration{0}, Duration::max()});
  /// Adds a list of names, each of which has options of its own: `add_members` adds them for the
  /// names that file, environment and flags say, or else for those that `names` holds. It is called
  /// once, from parse(), with different names of lower-case letters and digits, at most `size_max`
  /// bytes each.
  void add_group(std::string key, std::vector<std::string>& names, std::string help,
                 std::size_t size_max,
                 std::function<void(const std::vector<std::string>& names)> add_members);
  /// Adds an option that is one of `choices`.
  void add_choice(std::string key, std::string& value, const std::vector<std::string>& choices,
                  std::string help);

  /// Adds an argument that stands on the command line without a flag, in the order of adding; it
  /// has neither a variable of the environment nor a line in the file. A list takes all that are
  /// left, so it is added last.
  void add_positional(std::string name, std::string& value, std::string help,
                      Presence presence = Presence::kOptional);
  void add_positional(std::string name, std::vector<std::string>& value, std::string help,
                      Presence presence = Presence::kOptional);

  /// Adds a word that the first argument may be. Once there is one, parse() refuses all others.
  /// `arguments` is what stands behind it, "TARGET [JSON]"; `help` one line for --help; `details`,
  /// lines that each end with '\n', stands besides in what `PROGRAM VERB --help` prints.
  void add_verb(std::string name, std::string arguments, std::string help,
                std::string details = {});

  /// Adds --realtime prefer|require|off.
  void add_realtime(rt::RealtimeMode& mode);
  /// Adds --wait adaptive|periodic|block|spin and --spin DURATION, each with `prefix` before its
  /// key.
  void add_wait(rt::WaitConfig& wait, const std::string& prefix = {});
  /// Adds an option that is fifo or time-shared.
  void add_schedule(std::string key, rt::Schedule& schedule, std::string help);
  /// Adds --registry URL.
  void add_registry(std::string& url);

  /// Reads file, environment and command line into the variables. Nothing means: go on. A number is
  /// the exit code to end with: 0 after --help, --version or --dump-config, which print to standard
  /// output; 2 after an error, which is one sentence on standard error that names the option, what
  /// was expected and the remedy. Then some variables may already have changed.
  [[nodiscard]] std::optional<int> parse(int argc, const char* const* argv);

  /// Prints "<program>: <what>; run '<program> --help' …" on standard error, for what a program
  /// finds wrong with its options by itself. `what` is a clause without a full stop.
  /// @return 2, the exit code to end with.
  [[nodiscard]] int usage_error(std::string_view what) const;
  /// The same for a verb whose arguments are wrong: "<program>: usage: <program> <verb> …; run
  /// '<program> <verb> --help' …".
  [[nodiscard]] int usage_error_of_verb(std::string_view verb) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtpm::options
