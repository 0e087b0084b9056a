#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/time.hpp"
#include "rtpm/rt/thread.hpp"
#include "rtpm/rt/wait.hpp"

namespace rtpm::rpc {
struct NodeSecurity;
}

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

/// The options of one program, in one table: each has a key, and with it a flag `--key`, an
/// environment variable and a line `key = value` in the TOML file that `--config FILE` or
/// RTPM_CONFIG names. A flag overrides the environment, the environment overrides the file, and the
/// file overrides the default, the variable's value when it was added.
///
/// Programs share one environment, so a variable has one meaning: `--some-key` of `rtpm-servo` is
/// RTPM_SERVO_SOME_KEY. Options that this library adds to several programs are the same in all,
/// RTPM_SOME_KEY. An empty variable counts as none; one of another program is no error:
/// --dump-config lists it in a comment.
///
/// Every program also has --help, --help-all, --version, --config and --dump-config, which prints
/// the configuration in force in the format of --config.
///
/// @ownership refers to the added variables until parse() returns
/// @threads  one
/// @realtime set-up only
class Options {
 public:
  /// @param name  the program's, as users type it
  /// @param description  one clause for --help
  Options(const std::string& name, const std::string& description);

  /// The same table, where --help leaves added options to --help-all.
  /// @ownership refers to this object, as do those of the next functions
  [[nodiscard]] Options rare() const;
  /// The same table, where added options mean the same in every program, and stand in the file's
  /// table of that name, if any.
  [[nodiscard]] Options of_all_programs(const std::string& table = {}) const;
  /// The same table for one name of a group: "rate" is --device-arm0-rate, and rate in
  /// [device.arm0].
  [[nodiscard]] Options of_member(const std::string& table, const std::string& name) const;

  /// Adds an option: a text, a bool, a number, a Duration, a Priority, a list of texts, a list of
  /// CPU numbers, each 0 to 1023, a rt::Schedule, or an optional Duration, "off" if it has none. A
  /// bool's flag may omit its value: `--verbose`, or `--verbose=false`.
  /// @param key   lower-case letters, digits and `-`; not yet in use
  /// @param help  its effect, with its unit if its name has none
  /// @param range  of a number or a Duration
  template <class T>
  void add(const std::string& key, T& value, std::string help, Range<T> range = {});
  /// Adds an option that is one of `choices`.
  void add_choice(const std::string& key, std::string& value,
                  const std::vector<std::string>& choices, std::string help);
  /// Adds a secret, such as a password. It comes from the environment or the file, is refused on
  /// the command line, which all users of the host can read, and is never printed.
  void add_secret(const std::string& key, std::string& value, std::string help);
  /// Adds a list of names, each with options of its own in the file's table [TABLE.NAME]. parse()
  /// calls `add_members` once with those configured, or else those in `names` and those that have a
  /// table; it adds their options by of_member(). A name has letters, digits, '.',
  /// '_' and '-', at most `size_max` bytes. They differ in more than case and punctuation.
  void add_group(const std::string& key, const std::string& table, std::vector<std::string>& names,
                 std::string help, std::size_t size_max,
                 std::function<void(const std::vector<std::string>& names)> add_members);

  /// Adds --realtime prefer|require|off.
  void add_realtime(rt::RealtimeMode& mode);
  /// Adds --wait adaptive|periodic|block|spin and --spin DURATION.
  void add_wait(rt::WaitConfig& wait);
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

 private:
  struct Impl;
  /// The place of added options.
  struct Place {
    std::vector<std::string> tables{};  ///< In the file.
    std::string prefix{};               ///< Before the key in a flag: "device-arm0-".
    bool is_shared = false;             ///< The variable is the same in every program.
    bool is_rare = false;               ///< Only --help-all shows them.
  };
  Options(const Options& whole, Place place);

  std::shared_ptr<Impl> impl_;  ///< Owned by the first object only.
  Place place_{};
};

/// Adds the options of a program that calls servers, for NodeConfig::security: --key,
/// --known-servers and --key-log.
/// @ownership `security` must not move until Options::parse() has returned
/// @realtime set-up only
void add_caller(const Options& options, rpc::NodeSecurity& security);

}  // namespace rtpm::options
