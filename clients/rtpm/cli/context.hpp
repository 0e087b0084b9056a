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

/// "lab/arm0: …".
[[nodiscard]] SetupError named(const std::string& subject, SetupError error);

/// How the program ends.
enum ExitCode : int {
  kDone = 0,
  kFailed = 1,      ///< It failed, or the answer is no.
  kMisused = 2,     ///< The command line is wrong; nothing was done.
  kNotReached = 3,  ///< No registry, no server or no such name.
};

class Context;
/// Does what a command says. @return the exit code
using Run = std::function<int(Context&)>;

/// What every command is given: the options that all have, and the way to other programs.
/// @threads  one
class Context {
 public:
  /// Where names are looked for: a registry's URL, or the scope of discovery.
  std::string registry{names::kThisHost};
  bool json = false;                   ///< Prints JSON, a document per line.
  std::optional<Duration> deadline{};  ///< Of a call; none: the schema's, else 1 s.
  std::optional<Priority> priority{};  ///< Of a call; none: the schema's.
  rpc::NodeSecurity security{};        ///< Who the user is to servers, and which are known.
  Run chosen{};                        ///< The command that was parsed.

  /// The node of this program, made at the first call. It resolves names by the registry.
  [[nodiscard]] rpc::Node& node();
  /// Ctrl-C and the like. From the first call on they only ask to stop, so call it before node()
  /// where the command ends by itself.
  [[nodiscard]] const options::StopSignal& stop();
  [[nodiscard]] rpc::CallOptions call_options() const;

  /// Says on standard error why a command ends: a sentence, with --json {"error": {…}}.
  /// @return `code`
  int fail(const SetupError& error, ExitCode code = kFailed) const;
  int fail(std::string_view what, ExitCode code = kFailed) const;
  /// Tells a mistake in `text`, which is a `what` such as "filter", with its place.
  int fail_at(std::string_view what, const std::string& text,
              const predicate::TextError& error) const;
  /// As fail(), for a target that was not found or does not answer.
  /// Where this process lacks memory or descriptors for it, it just failed.
  int not_reached(const SetupError& error) const;

 private:
  std::unique_ptr<options::StopSignal> stop_{};
  std::unique_ptr<rpc::Node> node_{};
  std::unique_ptr<names::RegistryResolver> resolver_{};
};

}  // namespace rtpm::tool
