#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "rtpm/base/priority.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/names/defaults.hpp"
#include "rtpm/names/resolver.hpp"
#include "rtpm/predicate/text_error.hpp"
#include "rtpm/program/stop_signal.hpp"
#include "rtpm/rpc/binding.hpp"
#include "rtpm/rpc/node.hpp"

namespace rtpm::tool {

/// Prefixes the error with its subject: "lab/arm0: …".
[[nodiscard]] SetupError named(const std::string& subject, SetupError error);

/// The program's exit codes.
enum ExitCode : int {
  kDone = 0,
  kFailed = 1,      ///< The command failed, or the answer is no.
  kMisused = 2,     ///< The command line is invalid; nothing was done.
  kNotReached = 3,  ///< No registry, no server, or no such name.
};

class Context;
/// Runs a command. @return the exit code
using Run = std::function<int(Context&)>;

/// The common parts of all commands: their options, and access to other programs.
/// @threads  one
class Context {
 public:
  /// Where names are looked up: a registry's URL, or the scope of discovery.
  std::string registry{names::kThisHost};
  bool json = false;                   ///< Prints JSON, one document per line.
  std::optional<Duration> deadline{};  ///< A call's deadline; by default the schema's, or 1 s.
  std::optional<Priority> priority{};  ///< A call's priority; by default the schema's.
  rpc::NodeSecurity security{};  ///< The user's identity towards servers, and the known servers.
  Run chosen{};                  ///< The selected command.

  /// This program's node, created at the first call. Resolves names through the registry.
  [[nodiscard]] rpc::Node& node();
  /// The stop signals, such as Ctrl-C. From the first call on they only request an end. Call it
  /// before node() in commands that then end by themselves.
  [[nodiscard]] const program::StopSignal& stop();
  [[nodiscard]] rpc::CallOptions call_options() const;

  /// Reports on standard error why a command fails: as a sentence, or as {"error": {…}} with
  /// --json.
  /// @return `code`
  int fail(const SetupError& error, ExitCode code = kFailed) const;
  int fail(std::string_view what, ExitCode code = kFailed) const;
  /// Reports a mistake in `text`, with its position; `what` describes the text, such as "filter".
  int fail_at(std::string_view what, const std::string& text,
              const predicate::TextError& error) const;
  /// Reports a target that was not found or does not answer, like fail(). If this process lacks
  /// memory or descriptors, the code is kFailed.
  int not_reached(const SetupError& error) const;

 private:
  std::unique_ptr<program::StopSignal> stop_{};
  std::unique_ptr<rpc::Node> node_{};
  std::unique_ptr<names::RegistryResolver> resolver_{};
};

}  // namespace rtpm::tool
