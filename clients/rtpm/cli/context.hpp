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
#include "rtpm/options/stop_signal.hpp"
#include "rtpm/predicate/text_error.hpp"
#include "rtpm/rpc/binding.hpp"
#include "rtpm/rpc/node.hpp"

namespace rtpm::tool {

/// Puts the subject before the error: "lab/arm0: …".
[[nodiscard]] SetupError named(const std::string& subject, SetupError error);

/// The program's exit codes.
enum ExitCode : int {
  kDone = 0,
  kFailed = 1,      ///< It failed, or the answer is no.
  kMisused = 2,     ///< The command line is wrong; nothing was done.
  kNotReached = 3,  ///< No registry, no server or no such name.
};

class Context;
/// Runs a command. @return the exit code
using Run = std::function<int(Context&)>;

/// The environment of every command: the common options, and access to other programs.
/// @threads  one
class Context {
 public:
  /// The source of names: a registry's URL, or the scope of discovery.
  std::string registry{names::kThisHost};
  bool json = false;                   ///< Prints JSON, a document per line.
  std::optional<Duration> deadline{};  ///< A call's deadline; if unset, the schema's, or 1 s.
  std::optional<Priority> priority{};  ///< A call's priority; if unset, the schema's.
  rpc::NodeSecurity security{};        ///< The user's identity at servers, and the known servers.
  Run chosen{};                        ///< The command that was parsed.

  /// This program's node, made at the first call. It resolves names through the registry.
  [[nodiscard]] rpc::Node& node();
  /// Stop signals such as Ctrl-C. From the first call on they only request an end, so call it
  /// before node() where the command then ends by itself.
  [[nodiscard]] const options::StopSignal& stop();
  [[nodiscard]] rpc::CallOptions call_options() const;

  /// Reports on standard error why a command ends: a sentence, or {"error": {…}} with --json.
  /// @return `code`
  int fail(const SetupError& error, ExitCode code = kFailed) const;
  int fail(std::string_view what, ExitCode code = kFailed) const;
  /// Reports a mistake in `text`, which is a `what` such as "filter", with its position.
  int fail_at(std::string_view what, const std::string& text,
              const predicate::TextError& error) const;
  /// Reports a target that was not found or does not answer, like fail(). If this process lacks
  /// memory or descriptors, the code is kFailed.
  int not_reached(const SetupError& error) const;

 private:
  std::unique_ptr<options::StopSignal> stop_{};
  std::unique_ptr<rpc::Node> node_{};
  std::unique_ptr<names::RegistryResolver> resolver_{};
};

}  // namespace rtpm::tool
