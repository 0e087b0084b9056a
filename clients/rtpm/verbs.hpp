#pragma once

#include <optional>
#include <string>
#include <vector>

#include "rtpm/rpc/binding.hpp"
#include "rtpm/rpc/node.hpp"

namespace rtpm::tool {

/// What every verb is given.
struct Request {
  rpc::Node& node;
  rpc::Resolver& resolver;
  std::string registry{};
  std::vector<std::string> arguments{};  ///< Behind the verb.
  rpc::CallOptions options{};
  std::optional<Duration> stream_time{};  ///< How long a stream is taken; none: until it ends.
};

/// Runs `verb`: prints what it found, or one sentence on standard error. The program's exit code:
/// 0 done, 1 it failed, 2 a wrong command line.
[[nodiscard]] int run(const std::string& verb, const Request& request);

/// What the verbs are, for --help.
[[nodiscard]] std::string verbs_help();

}  // namespace rtpm::tool
