#pragma once

#include <cstdint>
#include <functional>
#include <limits>
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
  T low = std::numeric_limits<T>::lowest();
  T high = std::numeric_limits<T>::max();
};
template <>
struct Range<Duration> {
  Duration low{0};
  Duration high = Duration::max();
};
template <>
struct Range<Priority> {
  Priority low = Priority::kLowest;
  Priority high = Priority::kHighest;
};

struct Setting;

/// The options of one program, in one table: each has a key, and with it a flag `--key`, an
/// environment variable and a line `key = value` in the TOML file that `--config FILE` or
/// RTPM_CONFIG names. A flag overrides the environment, the environment overrides the file, and the
/// file overrides the default, the variable's value when it was added.
///
/// Programs share one environment, so a variable has one meaning: `--some-key` of `rtpm-servo` is
/// RTPM_SERVO_SOME_KEY. Options that this library adds to several programs are the same in all,
/// RTPM_SOME_KEY.
///
/// Every program also has --help, --help-all, --version, --config and --dump-config, which prints
/// the configuration in force in the format of --config.
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
  void add(const std::string& key, std::string& value, std::string help);
  void add(const std::string& key, bool& value, std::string help);
  void add(const std::string& key, std::vector<std::string>& value, std::string help);
  /// A list of CPU numbers, 0 to 1023.
  void add(const std::string& key, std::vector<int>& value, std::string help);
  /// Adds a number, a Duration or a Priority.
  template <class T>
  void add(const std::string& key, T& value, std::string help, Range<T> range = {});
  /// Adds an option that is a time, or "off" for none.
  void add_off_or_time(const std::string& key, std::optional<Duration>& value, std::string help);
  /// Adds an option that is one of `choices`.
  void add_choice(const std::string& key, std::string& value,
                  const std::vector<std::string>& choices, std::string help);
  /// Adds a secret, such as a password. It comes from the environment or the file, is refused on
  /// the command line, which all users of the host can read, and is never printed.
  /// @param file  the other place where it may be: "the file of --config"
  void add_secret(const std::string& key, std::string& value, std::string help,
                  const std::string& file = "the file of --config");
  /// Adds a list of names, each with options of its own in the file's table [TABLE.NAME]. parse()
  /// calls `add_members` once with those configured, or else those in `names` and those that have a
  /// table; it adds their options, each in a Scope::of_member(). A name has letters, digits, '.',
  /// '_' and '-', at most `size_max` bytes. They differ in more than case and punctuation.
  void add_group(const std::string& key, std::string table, std::vector<std::string>& names,
                 std::string help, std::size_t size_max,
                 std::function<void(const std::vector<std::string>& names)> add_members);

  /// Adds --realtime prefer|require|off.
  void add_realtime(rt::RealtimeMode& mode);
  /// Adds --wait adaptive|periodic|block|spin and --spin DURATION.
  void add_wait(rt::WaitConfig& wait);
  /// Adds an option that is fifo or time-shared.
  void add_schedule(const std::string& key, rt::Schedule& schedule, std::string help);
  /// Adds --registry URL and --discover HOW, which is for programs without --registry; `where` gets
  /// the one that counts. Once.
  void add_registry(std::string& where);

  class Scope;

  /// Reads file, environment and command line into the variables.
  /// @return nothing to continue, else the exit code: 0 after --help, --version or --dump-config
  /// @errors exit code 2, after one sentence on standard error; some variables may have changed
  [[nodiscard]] std::optional<int> parse(int argc, const char* const* argv);

  /// Prints "<program>: <what>; run '<program> --help' …" on standard error, for a program's own
  /// checks of its options. `what` is a clause without a full stop.
  /// @return 2, the exit code
  [[nodiscard]] int usage_error(std::string_view what) const;

 private:
  struct Impl;
  struct Group;
  struct Place;
  std::unique_ptr<Impl> impl_;
};

/// While it lives, the added options share a place, and that --help leaves them to --help-all.
/// @threads  one
class Options::Scope {
 public:
  /// Options that --help-all shows.
  [[nodiscard]] static Scope of_rare(Options& options);
  /// Options that mean the same in every program; in the file's table of that name, if any.
  [[nodiscard]] static Scope of_all_programs(Options& options, const std::string& table = {});
  /// Options of one name of a group: "rate" is --device-arm0-rate, and rate in [device.arm0].
  [[nodiscard]] static Scope of_member(Options& options, const std::string& table,
                                       const std::string& name);
  Scope(const Scope&) = delete;
  Scope& operator=(const Scope&) = delete;
  ~Scope();

 private:
  Scope(Options& options, Place place);
  Options& options_;
  std::unique_ptr<Place> former_;
};

}  // namespace rtpm::options
